"""The block LDL^T with delayed pivots and a border, against dense matrices."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, ldl

from der.kernels import block_ldl
from der.kernels.block_ldl import (
    MAX_DELAYED,
    Factors,
    inertia,
    invert,
    invert_three,
    solve_augmented,
    solve_band,
    solve_dense,
    solve_refined,
)
from der.kernels.workspace import workspace

SAFE = 1e-9  # what stability.py asks of the second value of `inertia`

Matrix = tuple[np.ndarray, np.ndarray, np.ndarray]  # diag (n, b, b), off (n, b, b), border

SIZES = pytest.mark.parametrize(
    ("n", "b", "m"),
    [
        (n, b, m)
        for n in (1, 2, 3, 5, 8, 12)
        for b in (1, 3, 4)
        for m in (0, 1, 2, 3, 5)
        if m <= n * b
    ],
)


def band(diag: np.ndarray, off: np.ndarray) -> np.ndarray:
    """T (n b, n b), dense."""
    n, b, _ = diag.shape
    T = block_diag(*diag)
    for j in range(n - 1):
        T[j * b : (j + 1) * b, (j + 1) * b : (j + 2) * b] = off[j]
        T[(j + 1) * b : (j + 2) * b, j * b : (j + 1) * b] = off[j].T
    return T


def dense(matrix: Matrix) -> np.ndarray:
    """K, dense."""
    diag, off, border = matrix
    n, b, m = border.shape
    B = border.reshape(n * b, m)
    return np.block([[band(diag, off), B], [B.T, np.zeros((m, m))]])


def random_matrix(seed: int, n: int, b: int, m: int, shift: float = 0.0) -> Matrix:
    """Symmetric blocks of normal numbers, ``shift`` added to the diagonal.

    The last block of ``off``, which would close a ring, is filled too: it must not matter.
    """
    rng = np.random.default_rng([seed, n, b, m])
    diag = rng.normal(size=(n, b, b))
    diag = 0.5 * (diag + diag.swapaxes(1, 2)) + shift * np.eye(b)
    off = rng.normal(size=(n, b, b))
    return diag, off, rng.normal(size=(n, b, m))


def factor(diag: np.ndarray, off: np.ndarray, border: np.ndarray) -> Factors:
    """Factors of K, in memory of their own."""
    return block_ldl.factor(diag, off, border, workspace(*border.shape))[0]


def solved(matrix: Matrix, f: np.ndarray, *, refined: bool = False) -> np.ndarray:
    """Solution z (n b + m, 2) of K z = f, with one more column and row that do nothing."""
    diag, off, border = matrix
    n, b, m = border.shape
    x, y, z = f[: n * b].reshape(n, b, 2).copy(), f[n * b :].copy(), np.zeros(2)
    nothing, none = np.zeros((n, b)), np.zeros(m)
    more = (m, nothing, none, nothing, none, 1.0, x, y, z, workspace(n, b, m))
    if refined:
        assert solve_refined(diag, off, factor(*matrix), *more)
    else:
        assert solve_augmented(factor(*matrix), *more)
    return np.vstack([x.reshape(n * b, 2), y])


def right_hand_sides(matrix: Matrix) -> np.ndarray:
    """Two columns of normal numbers."""
    n, b, m = matrix[2].shape
    return np.random.default_rng(0).normal(size=(n * b + m, 2))


def backward_error(matrix: Matrix, *, refined: bool = False) -> float:
    """Normwise |K z - f|/(|K| |z| + |f|) of two right-hand sides."""
    K, f = dense(matrix), right_hand_sides(matrix)
    z = solved(matrix, f, refined=refined)
    return float(np.max(np.abs(K @ z - f)) / (np.abs(K).max() * np.abs(z).max() + np.abs(f).max()))


def negatives(K: np.ndarray) -> int:
    return int(np.sum(np.linalg.eigvalsh(K) < 0.0))


def hostile(name: str) -> Matrix:
    """Regular matrices whose pivot blocks are singular, zero or apart."""
    diag, off, border = random_matrix(11, 8, 3, 3)
    if name == "first block of rank 1":
        diag[0] = np.outer([1.0, 2.0, -1.0], [1.0, 2.0, -1.0])
    elif name == "every block of rank 1":
        v = np.random.default_rng(1).normal(size=(8, 3))
        diag = v[:, :, None] * v[:, None, :]
    elif name == "first block zero":
        diag[0] = 0.0
    elif name == "every diagonal block zero":
        diag[:] = 0.0
    elif name == "zero diagonal":
        diag[:, range(3), range(3)] = 0.0
    elif name == "singular Schur complement":
        diag[0], off[0] = np.eye(3), np.eye(3)
        diag[1] = np.eye(3) + np.diag([0.0, 1e-9, 1.0])
    elif name == "two bands":
        off[3] = 0.0
    elif name == "two bands, each singular":
        off[3] = 0.0
        diag[0] = diag[4] = np.diag([1.0, 0.0, 2.0])
        off[0] = off[4] = 0.0
    elif name == "all apart":
        off[:] = 0.0
    elif name == "scales from 1e-6 to 1":
        scale = np.logspace(-3, 0, 8)[:, None, None]
        diag = scale**2 * diag
        off[:7] *= scale[:7] * scale[1:]
        border = scale * border
    return diag, off, border


HOSTILE = pytest.mark.parametrize(
    "name",
    [
        "first block of rank 1",
        "every block of rank 1",
        "first block zero",
        "every diagonal block zero",
        "zero diagonal",
        "singular Schur complement",
        "two bands",
        "two bands, each singular",
        "all apart",
        "scales from 1e-6 to 1",
    ],
)


# --- one dense block ------------------------------------------------------------------------


@pytest.mark.parametrize("m", range(1, 7))
@pytest.mark.parametrize("kind", ["full", "zero diagonal", "definite"])
def test_invert_a_block(m, kind):
    """-A^-1 by sweeps with Bunch-Parlett pivots; error below 1e-14 times the condition number."""
    A = np.random.default_rng(m).normal(size=(m, m))
    A = A @ A.T if kind == "definite" else A + A.T
    if kind == "zero diagonal":
        np.fill_diagonal(A, 0.0)
        if m % 2:
            A[0, 0] = 1.0
    swept = A.copy()
    invert(swept, 0.0, np.zeros(m))
    expected = -np.linalg.inv(A)
    assert_allclose(
        swept, expected, rtol=0, atol=1e-14 * np.linalg.cond(A) * np.abs(expected).max()
    )


def test_three_by_formula_is_three_by_sweeps():
    """Where `invert_three` takes a block: the same -A^-1 and count; where not, A stays as it is."""
    taken = 0
    for seed in range(40):
        A = np.random.default_rng(seed).normal(size=(3, 3))
        A = A + A.T
        by_formula, by_sweeps = A.copy(), A.copy()
        negative = invert_three(by_formula, 1e-4)
        if negative < 0:
            assert_allclose(by_formula, A, rtol=0, atol=0)
            continue
        taken += 1
        assert negative == negatives(A) == invert(by_sweeps, 0.0, np.zeros(3))[0]
        assert_allclose(by_formula, by_sweeps, rtol=1e-12, atol=1e-12 * np.abs(by_sweeps).max())
    assert 5 < taken < 40
    for small in np.diag([1e-6, 1.0, 1.0]), np.diag([1.0, 1e-6, 1.0]), np.diag([1.0, 1.0, 1e-6]):
        assert invert_three(small, 1e-4) == -1


@pytest.mark.parametrize("m", range(1, 7))
@pytest.mark.parametrize("seed", range(4))
def test_inertia_of_a_block(m, seed):
    """Sylvester: the pivots have the signs of the eigenvalues and of SciPy's dense LDL^T."""
    A = np.random.default_rng([m, seed]).normal(size=(m, m))
    A = A + A.T
    negative, _ = invert(A.copy(), 0.0, np.zeros(m))
    assert negative == negatives(A) == negatives(ldl(A)[1])


@pytest.mark.parametrize("pair", [False, True])
def test_zero_pivot_ends_with_zero(pair):
    """Rank 1 or 2 of 3: what is left is zero, said by the second value, and nothing is divided."""
    A = np.zeros((3, 3))
    A[0, 0] = 0.0 if pair else -2.0
    A[0, 1] = A[1, 0] = 1.0 if pair else 0.0
    assert invert(A, 0.0, np.zeros(3)) == (1, 0.0)


def test_small_pivot_is_raised_to_the_size_of_the_matrix():
    """Below the threshold 1e-4 of size 1, the largest entry left is raised by 1, and says so."""
    A, delayed = np.diag([1.0, 1e-6, -1e-5]), np.zeros(3)
    invert(A, 1e-4, delayed)
    assert_allclose(delayed, [0.0, 1.0, 1.0], rtol=1e-15)
    assert_allclose(A, -np.diag([1.0, 1.0 / (1.0 + 1e-6), 1.0 / (1.0 - 1e-5)]), rtol=1e-15)


@pytest.mark.parametrize("m", range(1, 9))
def test_solve_dense(m):
    """Partial pivoting against NumPy, a zero first entry included; 1e-14 times the condition."""
    rng = np.random.default_rng(m)
    A, x = rng.normal(size=(m, m)), rng.normal(size=(m, 2))
    if m > 1:
        A[0, 0] = 0.0
    expected = np.linalg.solve(A, x)
    condition = np.linalg.cond(A)
    assert solve_dense(A, x)
    assert_allclose(x, expected, rtol=0, atol=1e-14 * condition * np.abs(expected).max())


def test_solve_dense_says_where_a_pivot_is_zero():
    """An exactly singular matrix is refused, not divided by."""
    assert not solve_dense(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones((2, 1)))


# --- the bordered band ----------------------------------------------------------------------


@SIZES
def test_inertia_of_indefinite_matrices(n, b, m):
    """Negative pivots of band and border are the negative eigenvalues of K (Haynsworth).

    Random matrices, none with an eigenvalue below 1e-4 of the largest.
    """
    for seed in range(3):
        matrix = random_matrix(seed, n, b, m)
        assert inertia(factor(*matrix))[0] == negatives(dense(matrix))


@SIZES
def test_inertia_of_definite_bands(n, b, m):
    """T > 0: exactly one negative eigenvalue for each condition, as the index relies on."""
    matrix = random_matrix(3, n, b, m, shift=4.0 * b)
    assert np.linalg.eigvalsh(band(*matrix[:2]))[0] > 0.0
    assert inertia(factor(*matrix))[0] == m


@SIZES
def test_backward_error_of_indefinite_systems(n, b, m):
    """Pivots above 1e-4 let the band grow by 1e4, and the border once more: 1e8 times 1e-16.

    Typically it is 1e-14. A general matrix is not the rod's, whose pivots are larger.
    """
    for seed in range(3):
        assert backward_error(random_matrix(seed, n, b, m)) < 1e-8


@SIZES
def test_solution_agrees_with_numpy(n, b, m):
    """The same z as np.linalg.solve to the backward error above times the condition number."""
    matrix = random_matrix(4, n, b, m)
    K, f = dense(matrix), right_hand_sides(matrix)
    expected = np.linalg.solve(K, f)
    atol = 1e-8 * np.linalg.cond(K) * np.abs(expected).max()
    assert_allclose(solved(matrix, f), expected, rtol=0, atol=atol)


@SIZES
def test_refined_solution(n, b, m):
    """`solve_refined` refines where the residual is above 1e-12 of its terms: never above that."""
    for seed in range(3):
        assert backward_error(random_matrix(seed, n, b, m), refined=True) < 1e-12


@pytest.mark.parametrize("n", [1, 2, 7])
def test_solve_band_of_a_definite_matrix(n):
    """T^-1 x where no pivot is delayed; conditions below 100, so 1e-13."""
    matrix = random_matrix(5, n, 3, 0, shift=10.0)
    factors = factor(*matrix)
    x = np.random.default_rng(5).normal(size=(n, 3, 2))
    expected = np.linalg.solve(band(*matrix[:2]), x.reshape(3 * n, 2))
    solve_band(factors.inverse, factors.lower, x)
    assert factors.schur.shape == (0, 0)
    assert_allclose(x.reshape(3 * n, 2), expected, rtol=0, atol=1e-13)


@HOSTILE
def test_inertia_of_hostile_matrices(name):
    """Singular, zero and separate blocks of a regular K: the count of its eigenvalues."""
    matrix = hostile(name)
    factors = factor(*matrix)
    assert inertia(factors)[0] == negatives(dense(matrix))


@HOSTILE
def test_backward_error_of_hostile_systems(name):
    """Delayed pivots keep growth below 1e4 in band and border: 1e8 times 1e-16."""
    assert backward_error(hostile(name)) < 1e-8


@HOSTILE
def test_refined_solution_of_hostile_systems(name):
    """One refinement brings 1e-8 to rounding; it is done where the error is above 1e-12."""
    assert backward_error(hostile(name), refined=True) < 1e-12


@HOSTILE
def test_margin_of_a_regular_matrix_is_far_from_rounding(name):
    """The second value does not cry wolf: above 1e-6 where K is well conditioned."""
    assert inertia(factor(*hostile(name)))[1] > 1e-6


def nearly_singular(seed: int, n: int, m: int, eigenvalue: float) -> Matrix:
    """K whose band has the given eigenvalue on the null space of the border's conditions."""
    diag, off, border = random_matrix(seed, n, 3, m)
    _, _, vt = np.linalg.svd(border.reshape(3 * n, m).T)
    Z = vt[m:].T
    values = np.linalg.eigvalsh(Z.T @ band(diag, off) @ Z)
    shift = values[np.argmin(np.abs(values))] - eigenvalue
    return diag - shift * np.eye(3), off, border


@pytest.mark.parametrize("m", [0, 1, 3])
@pytest.mark.parametrize("n", [2, 6, 12])
def test_singular_matrix_is_flagged(n, m):
    """An eigenvalue of zero, but for rounding, shows in the second value: below SAFE."""
    for seed in range(10):
        assert inertia(factor(*nearly_singular(seed, n, m, 0.0)))[1] < SAFE


@pytest.mark.parametrize("m", [0, 1, 3])
@pytest.mark.parametrize("n", [2, 6, 12])
@pytest.mark.parametrize("eigenvalue", [1e-15, -1e-14, 1e-13, -1e-12, 1e-11, -1e-10, 1e-8])
def test_count_is_right_or_flagged(n, m, eigenvalue):
    """Sylvester, with the small eigenvalue's sign by construction: never wrong and called safe."""
    for seed in range(10):
        matrix = nearly_singular(seed, n, m, eigenvalue)
        large = np.linalg.eigvalsh(dense(matrix))
        large = np.delete(large, np.argmin(np.abs(large)))
        count, margin = inertia(factor(*matrix))
        assert count == np.sum(large < 0.0) + (eigenvalue < 0.0) or margin < SAFE


@pytest.mark.parametrize("m", [0, 1, 3])
@pytest.mark.parametrize("n", [2, 6, 12])
@pytest.mark.parametrize("eigenvalue", [1e-7, -1e-7])
def test_count_near_a_fold(n, m, eigenvalue):
    """An eigenvalue of 1e-7, of either sign, is far above rounding: the count is right."""
    for seed in range(3):
        matrix = nearly_singular(seed, n, m, eigenvalue)
        assert inertia(factor(*matrix))[0] == negatives(dense(matrix))


def test_more_conditions_than_unknowns_are_flagged():
    """Five conditions on three unknowns make K singular: margin at rounding."""
    assert inertia(factor(*random_matrix(6, 1, 3, 5)))[1] < 1e-14


def many_zero_pivots(count: int) -> Matrix:
    """Separate diagonal blocks with ``count`` zeros, which as many border columns make regular."""
    diag, off = np.tile(np.diag([1.0, -2.0, 3.0]), (12, 1, 1)), np.zeros((12, 3, 3))
    border = np.zeros((12, 3, count))
    for d in range(count):
        diag[d, 1, 1], border[d, 1, d] = 0.0, 1.0
    return diag, off, border


def test_as_many_delayed_pivots_as_allowed():
    """Eight: each zero makes with its border column one positive and one negative eigenvalue."""
    matrix = many_zero_pivots(MAX_DELAYED)
    factors = factor(*matrix)
    assert factors.border.shape[2] == 2 * MAX_DELAYED
    assert inertia(factors)[0] == negatives(dense(matrix))


def test_more_delayed_pivots_than_allowed_is_a_named_failure():
    """Nine: the factorisation gives up, and the count is -1 with margin 0."""
    factors = factor(*many_zero_pivots(MAX_DELAYED + 1))
    assert factors.negative == -1
    assert inertia(factors) == (-1, 0.0)


# --- one more row and column ----------------------------------------------------------------


class Augmented(NamedTuple):
    """A system with one more column and row, solved densely and by the structured solver."""

    expected: np.ndarray
    found: np.ndarray
    condition: float


def augmented(matrix: Matrix, seed: int, *, refined: bool = False) -> Augmented:
    """Random column, row and corner around K, and two right-hand sides."""
    diag, off, border = matrix
    n, b, m = border.shape
    rng = np.random.default_rng(seed)
    column, row = rng.normal(size=(2, n, b))
    column_border, row_border = rng.normal(size=(2, m))
    corner = float(rng.normal())
    x, y, z = rng.normal(size=(n, b, 2)), rng.normal(size=(m, 2)), rng.normal(size=2)
    A = np.block(
        [
            [dense(matrix), np.append(column, column_border)[:, None]],
            [np.append(row, row_border)[None, :], np.array([[corner]])],
        ]
    )
    expected = np.linalg.solve(A, np.vstack([x.reshape(n * b, 2), y, z]))
    more = (m, column, column_border, row, row_border, corner, x, y, z, workspace(n, b, m))
    if refined:
        assert solve_refined(diag, off, factor(*matrix), *more)
    else:
        assert solve_augmented(factor(*matrix), *more)
    found = np.vstack([x.reshape(n * b, 2), y, z])
    return Augmented(expected, found, float(np.linalg.cond(A)))


REFINED = pytest.mark.parametrize(
    ("refined", "error"), [(False, 1e-8), (True, 1e-12)], ids=["plain", "refined"]
)


@SIZES
@REFINED
def test_augmented_system(n, b, m, refined, error):
    """Unsymmetric row and column against NumPy: backward error, as above, times the condition."""
    it = augmented(random_matrix(7, n, b, m), 7, refined=refined)
    atol = error * it.condition * np.abs(it.expected).max()
    assert_allclose(it.found, it.expected, rtol=0, atol=atol)


@pytest.mark.parametrize(("n", "m"), [(1, 0), (1, 2), (2, 1), (6, 0), (6, 3), (12, 1), (12, 3)])
@REFINED
def test_augmented_system_at_a_fold(n, m, refined, error):
    """K singular to rounding, the augmented matrix regular: no digit is lost to K's condition.

    Backward error, as above, times the condition of the augmented matrix, which is below 1e4.
    """
    it = augmented(nearly_singular(8, n, m, 0.0), 8, refined=refined)
    assert it.condition < 1e4
    atol = error * it.condition * np.abs(it.expected).max()
    assert_allclose(it.found, it.expected, rtol=0, atol=atol)


@pytest.mark.parametrize("refined", [False, True], ids=["plain", "refined"])
def test_augmented_system_at_an_exact_fold(refined):
    """K singular to the last digit, from integers; small and tame: 1e-13."""
    matrix = (
        np.array([[[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0]], np.diag([-1.0, 3.0, 2.0])]),
        np.zeros((2, 3, 3)),
        np.zeros((2, 3, 1)),
    )
    matrix[2][1, 2, 0] = 1.0
    assert np.linalg.det(dense(matrix)) == 0.0
    it = augmented(matrix, 9, refined=refined)
    assert_allclose(it.found, it.expected, rtol=0, atol=1e-13 * np.abs(it.expected).max())


@pytest.mark.parametrize("refined", [False, True], ids=["plain", "refined"])
def test_singular_augmented_system_is_refused(refined):
    """A row and column of zeros: said, not divided by."""
    matrix = random_matrix(10, 2, 3, 1, shift=10.0)
    nothing, none = np.zeros((2, 3)), np.zeros(1)
    x, y, z = np.ones((2, 3, 1)), np.ones((1, 1)), np.ones(1)
    more = (1, nothing, none, nothing, none, 0.0, x, y, z, workspace(2, 3, 1))
    if refined:
        assert not solve_refined(*matrix[:2], factor(*matrix), *more)
    else:
        assert not solve_augmented(factor(*matrix), *more)


def test_solution_that_refinement_cannot_mend_is_refused():
    """Factors of another matrix leave a residual of order 1, refined or not: said so."""
    diag, off, border = random_matrix(13, 6, 3, 1)
    factors = factor(2.5 * diag, off, border)
    x, y, z = np.ones((6, 3, 1)), np.ones((1, 1)), np.ones(1)
    nothing, none = np.zeros((6, 3)), np.zeros(1)
    more = (1, nothing, none, nothing, none, 1.0, x, y, z, workspace(6, 3, 1))
    assert not solve_refined(diag, off, factors, *more)
