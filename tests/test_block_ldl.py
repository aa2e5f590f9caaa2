"""The block LDL^T with delayed pivots and a border, against dense matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, ldl

from der.block_ldl import (
    MAX_DELAYED,
    factor,
    inertia,
    invert,
    multiply,
    solve_augmented,
    solve_band,
    solve_dense,
)

Matrix = tuple[np.ndarray, np.ndarray, np.ndarray]  # diag (n, b, b), off (n, b, b), border

SIZES = pytest.mark.parametrize(
    ("n", "b", "m"),
    [(n, b, m) for n in (1, 2, 3, 5, 8, 12) for b in (3, 4) for m in (0, 1, 2, 3, 5) if m <= n * b],
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

    The last block of ``off`` joins the last edge of a ring to the first and must not be read: NaN.
    """
    rng = np.random.default_rng([seed, n, b, m])
    diag = rng.normal(size=(n, b, b))
    diag = 0.5 * (diag + diag.swapaxes(1, 2)) + shift * np.eye(b)
    off = rng.normal(size=(n, b, b))
    off[-1] = 0.0
    return diag, off, rng.normal(size=(n, b, m))


def solved(matrix: Matrix, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solution of K (x, y) by the structured solver, with a column and row that do nothing."""
    n, b, m = matrix[2].shape
    x, y = x.copy(), y.copy()
    nothing, none = np.zeros((n, b)), np.zeros(m)
    r = x.shape[2]
    assert solve_augmented(factor(*matrix), m, nothing, none, nothing, none, 1.0, x, y, np.zeros(r))
    return x, y


def residual(matrix: Matrix, seed: int = 0) -> float:
    """Normwise backward error |K x - f|/(|K| |x| + |f|) of two right-hand sides."""
    n, b, m = matrix[2].shape
    rng = np.random.default_rng(seed)
    x, y = solved(matrix, f := rng.normal(size=(n, b, 2)), g := rng.normal(size=(m, 2)))
    K = dense(matrix)
    z, h = np.vstack([x.reshape(n * b, 2), y]), np.vstack([f.reshape(n * b, 2), g])
    return float(np.max(np.abs(K @ z - h)) / (np.abs(K).max() * np.abs(z).max() + np.abs(h).max()))


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
def test_solution_of_indefinite_systems(n, b, m):
    """Backward error of K z = f; growth by delayed pivots is at most 1e4, so 1e-16 may be 1e-12."""
    for seed in range(3):
        assert residual(random_matrix(seed, n, b, m)) < 1e-12


@SIZES
def test_solution_agrees_with_numpy(n, b, m):
    """The same z as np.linalg.solve to 1e-12 times the condition number."""
    matrix = random_matrix(4, n, b, m)
    rng = np.random.default_rng(4)
    x, y = rng.normal(size=(n, b, 2)), rng.normal(size=(m, 2))
    K = dense(matrix)
    expected = np.linalg.solve(K, np.vstack([x.reshape(n * b, 2), y]))
    x, y = solved(matrix, x, y)
    atol = 1e-12 * np.linalg.cond(K) * np.abs(expected).max()
    assert_allclose(np.vstack([x.reshape(n * b, 2), y]), expected, rtol=0, atol=atol)


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
def test_solution_of_hostile_systems(name):
    """Delayed pivots keep growth below 1e4: backward error below 1e-12."""
    assert residual(hostile(name)) < 1e-12


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
@pytest.mark.parametrize("eigenvalue", [0.0, 1e-13, -1e-13])
def test_nearly_singular_matrix_is_flagged(n, m, eigenvalue):
    """An eigenvalue within 1e-13 of zero shows in the second value, below 1e-10."""
    for seed in range(3):
        _, margin = inertia(factor(*nearly_singular(seed, n, m, eigenvalue)))
        assert margin < 1e-10


@pytest.mark.parametrize("m", [0, 1, 3])
@pytest.mark.parametrize("n", [2, 6, 12])
@pytest.mark.parametrize("eigenvalue", [1e-7, -1e-7])
def test_count_near_a_fold(n, m, eigenvalue):
    """An eigenvalue of 1e-7, of either sign, is far above rounding: the count is right."""
    for seed in range(3):
        matrix = nearly_singular(seed, n, m, eigenvalue)
        assert inertia(factor(*matrix))[0] == negatives(dense(matrix))


def test_matrix_of_zeros_is_flagged():
    """No pivot at all: margin 0."""
    assert inertia(factor(np.zeros((3, 3, 3)), np.zeros((3, 3, 3)), np.ones((3, 3, 1))))[1] == 0.0


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


def augmented(matrix: Matrix, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, bool]:
    """Dense solution and the structured one for a random column, row and corner."""
    n, b, m = matrix[2].shape
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
    done = solve_augmented(
        factor(*matrix), m, column, column_border, row, row_border, corner, x, y, z
    )
    return expected, np.vstack([x.reshape(n * b, 2), y, z]), A, float(np.linalg.cond(A)), done


@SIZES
def test_augmented_system(n, b, m):
    """Unsymmetric row and column against NumPy, to 1e-12 times the condition number."""
    expected, found, _, condition, done = augmented(random_matrix(7, n, b, m), 7)
    assert done
    assert_allclose(found, expected, rtol=0, atol=1e-12 * condition * np.abs(expected).max())


@pytest.mark.parametrize("m", [0, 1, 3])
@pytest.mark.parametrize("n", [1, 2, 6, 12])
def test_augmented_system_at_a_fold(n, m):
    """K singular to rounding, the augmented matrix regular: no digit is lost to K's condition.

    To 1e-12 times the condition of the augmented matrix, which is below 1e4.
    """
    if m == 3 and n == 1:
        m = 2
    expected, found, _, condition, done = augmented(nearly_singular(8, n, m, 0.0), 8)
    assert done
    assert condition < 1e4
    assert_allclose(found, expected, rtol=0, atol=1e-12 * condition * np.abs(expected).max())


def test_augmented_system_at_an_exact_fold():
    """K singular to the last digit, from whole numbers: still solved, to 1e-13."""
    matrix = (
        np.array([[[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0]], np.diag([-1.0, 3.0, 2.0])]),
        np.zeros((2, 3, 3)),
        np.zeros((2, 3, 1)),
    )
    matrix[2][1, 2, 0] = 1.0
    assert np.linalg.det(dense(matrix)) == 0.0
    expected, found, _, _, done = augmented(matrix, 9)
    assert done
    assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_singular_augmented_system_is_refused():
    """A row and column of zeros: said, not divided by."""
    matrix = random_matrix(10, 2, 3, 1, shift=10.0)
    nothing, none = np.zeros((2, 3)), np.zeros(1)
    x, y, z = np.ones((2, 3, 1)), np.ones((1, 1)), np.ones(1)
    assert not solve_augmented(factor(*matrix), 1, nothing, none, nothing, none, 0.0, x, y, z)


@SIZES
def test_multiply(n, b, m):
    """K (x, y) against the dense product; a few roundings of sums of up to 20 terms."""
    matrix = random_matrix(12, n, b, m)
    rng = np.random.default_rng(12)
    x, y = rng.normal(size=(n, b, 2)), rng.normal(size=(m, 2))
    expected = dense(matrix) @ np.vstack([x.reshape(n * b, 2), y])
    out_x, out_y = np.empty_like(x), np.empty_like(y)
    multiply(*matrix, x, y, out_x, out_y)
    assert_allclose(np.vstack([out_x.reshape(n * b, 2), out_y]), expected, rtol=0, atol=1e-13)
