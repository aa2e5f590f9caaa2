"""What is found on the steps of a path where special points lie close together."""

import functools
import math
from itertools import pairwise

import numpy as np
import pytest
from rods import lifted

import der
from der.analysis.request import Request
from der.analysis.self_crossing import _on_its_side
from der.continuation.bifurcations import is_fold
from der.continuation.events import Mark, located
from der.continuation.extrema import _bisected
from der.continuation.step import SAME, between
from der.problem import Options, Point, Statistics, total_index
from der.rod.gripped_ring import gripped_ring
from der.rod.stability import index

# h/t = 2.5075: beyond the first fold one out-of-phase mode is unstable for 6e-5 rad of gamma
NEARLY = der.triangle(math.radians(60), 0.0866)
SECTION = der.rectangular_section(2.5075)
SIXTY = der.triangle(math.radians(60), 1 / 30)
STADIUM = der.rectangle(0.2, 0.2)


def branches(ring, h_over_t, **numerics):
    scene = der.Scene(ring, der.rectangular_section(h_over_t), self_crossings=False, **numerics)
    path = der.fold(scene)
    return [(p.gamma, p.details["symmetry"], p.index_before, p.index_after) for p in path.branches]


def step_over_both():
    """The step from before the first fold to a state beyond the second change of the index."""
    ring = gripped_ring(NEARLY, SECTION, 64)
    found = list(Request(targets=(), stability=False, self_crossings=False).follow(ring))
    fold = next(k for k, one in enumerate(found) if one.kind == "fold")
    a, b = (next(v for v in side if not v.kind) for side in (found[fold::-1], found[fold:]))
    return step_between(ring, a, b)


def step_between(ring, a, b):
    """The step between two neighbouring points of a path."""
    return between(ring, a.solution, b.solution, tolerance=1e-10, statistics=Statistics())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_contact_stands_on_the_side_of_a_state_that_its_load_says(side):
    """Where the place of that state is a little off, and only there."""
    step = step_over_both()
    s = 0.1 * step.length
    asked = Mark(s, Point(step.at(s)))
    line = [Mark(0.0, Point(step.start)), asked, Mark(step.length, Point(step.end))]
    near, far = 0.5 * SAME * step.length, 1e-2 * step.length
    for off, said, expected in ((near, -side, side), (near, side, side), (far, -side, -side)):
        contact = Mark(s + said * off, Point(step.at(s + side * near), "contact"))
        placed = _on_its_side(step, line, contact)
        assert (placed.s - s) * expected > 0.0
        assert abs(placed.s - contact.s) <= 1.01 * near
        assert placed.point is contact.point


# --- two changes within one step --------------------------------------------------------------


@pytest.mark.parametrize("h_over_t", [3.446, 3.5, 3.505])
def test_two_limits_within_one_step_are_found_at_any_length_of_steps(h_over_t):
    """Between two limits 0.05 and 0.009 rad apart M is all but level; at h/t = 3.505 they are gone.

    Truth: steps a seventh as long.
    """
    section = der.rectangular_section(h_over_t, nu=0.5)
    ring = gripped_ring(der.circle(), section, 32, measure="angle")
    found, other = (
        [
            one.solution.parameter
            for one in Request(targets=(1.64, 1.69), self_crossings=False, options=options).follow(
                ring
            )
            if one.kind
        ]
        for options in (Options(), Options(largest_step=0.05))
    )
    assert len(found) == len(other)
    assert found == pytest.approx(other, abs=1e-8)


def test_two_changes_of_an_index_within_one_step_are_found():
    """A class that is unstable on half of a step only, with equal indices at the step's two ends.

    Truth: the index counted at 400 places of the step; what is found lies between neighbours.
    """
    step = step_over_both()
    ring = step.system
    s = np.linspace(0.0, step.length, 400)
    counted = np.array([ring.count(step.at(x).state, "out of phase") for x in s])
    changes = np.flatnonzero(np.diff(counted))
    assert counted[0] == counted[-1] == 0
    assert len(changes) == 2
    request = Request(targets=(), self_crossings=False)
    here = request.point(ring, step.start)
    found, _ = located(request.events(ring), step, here)
    pair = [one for one in found if one.kind == "branch"]
    assert [one.details["symmetry"] for one in pair] == ["out of phase"] * 2
    for one, k in zip(pair, changes, strict=True):
        beyond, before = step.at(s[k + 1]).parameter, step.at(s[k]).parameter
        assert beyond < one.solution.parameter < before  # gamma runs back here


def test_both_changes_are_on_the_path():
    """The path has the fold, the two branch points and the other fold, told apart."""
    found = der.fold(der.Scene(NEARLY, SECTION, self_crossings=False))
    kinds = [(p.kind, p.index_before, p.index_after) for p in found.points if p.kind != "limit"]
    assert kinds == [("fold", 0, 1), ("branch", 1, 2), ("branch", 2, 1), ("fold", 1, 0)]


@functools.cache
def of_curved(natural_curvature: float, alpha: float, name: str, n_edges: int) -> tuple:
    """Branch points of a circle of another natural curvature, alpha = beta: class, gamma, index."""
    ring = gripped_ring(
        der.circle(natural_curvature=natural_curvature),
        der.section(alpha, alpha),
        n_edges,
        name=name,
    )
    points = list(Request(self_crossings=False, limits=False).follow(ring))
    return tuple(
        (one.solution.parameter, *(total_index(ring, side) for side in one.sides))
        for one in points
        if one.kind == "branch"
    )


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
@pytest.mark.parametrize(
    ("n_edges", "first", "second"), [(64, 1.81974, 1.84745), (128, 1.81741, 1.84162)]
)
def test_a_pair_of_branch_points_within_one_step(name, n_edges, first, second):
    """Natural curvature -1, alpha = beta = 1.3: index 8, 7, 8. On some meshes both lie in one step.

    The mode's stiffness goes from -0.2 to 0.1 and back to -0.3 there, in units of torsion's.
    """
    found = of_curved(-1.0, 1.3, name, n_edges)
    k = next(k for k, one in enumerate(found) if one[1:] == (8, 7))
    assert found[k][0] == pytest.approx(first, abs=1e-5)
    assert found[k + 1][0] == pytest.approx(second, abs=1e-5)
    assert found[k + 1][1:] == (7, 8)


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_a_pair_whose_mode_softens_late(name):
    """Stiffness -1.35, 0, 0, -0.27 in a step: the tangent at its start stays far from zero.

    Truth: steps a sixth and a thirtieth as long.
    """
    found = of_curved(-2.9774933970369535, 1.0235429748055407, name, 64)
    k = next(k for k, one in enumerate(found) if one[1:] == (4, 3))
    assert [one[1:] for one in found[k : k + 2]] == [(4, 3), (3, 4)]
    assert [one[0] for one in found[k : k + 2]] == pytest.approx([1.2132843, 1.2142055], abs=1e-7)


@pytest.mark.parametrize(
    ("natural_curvature", "alpha", "n_edges"),
    [
        (-0.9403747811199694, 1.5381643514719432, 64),  # the full ring once missed a pair
        (-0.9403747811199694, 1.5381643514719432, 128),  # the half and the full ring did
        (-1.02021926768725, 1.6743239305044937, 128),  # -0.70, 0.14, -0.54 within a step
        (-1.1965531979508512, 1.185868096707137, 64),  # ends 4e-7 rad before a fold, softer yet
        (-1.463461535912722, 1.4773255018060687, 64),  # of two modes, 7e-4 rad apart
    ],
)
def test_all_sectors_find_the_same_branch_points(natural_curvature, alpha, n_edges):
    """The index of the full ring on the two sides of each, and gamma, to 1e-7.

    A pair of odd modes is one point on the quarter, and one for each class on the half.
    """

    def steps(name):
        jumps: dict[float, int] = {}
        for gamma, before, after in of_curved(natural_curvature, alpha, name, n_edges):
            key = round(gamma, 6)
            jumps[key] = jumps.get(key, 0) + after - before
        return jumps

    assert steps("quarter") == steps("half") == steps("full")


# --- places -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("ring", "h_over_t"), [(STADIUM, 1.5), (SIXTY, 4.0)])
@pytest.mark.parametrize("tolerance", [1e-8, 1e-10])
def test_branch_points_do_not_depend_on_the_tolerance(ring, h_over_t, tolerance):
    """Gamma at branch points is good to 1e-8; measured below 1e-12 from 1e-8 on."""
    found = branches(ring, h_over_t, tolerance=tolerance)
    exact = branches(ring, h_over_t, tolerance=1e-12)
    assert [one[1:] for one in found] == [one[1:] for one in exact]
    assert [one[0] for one in found] == pytest.approx([one[0] for one in exact], abs=1e-10)


def test_a_branch_of_one_arm_against_the_other():
    """The out-of-phase mode of a mirror-symmetric ring crosses zero singly, away from folds.

    Truth: on the full ring the index changes at the same gamma, by one.
    """
    half = branches(SIXTY, 4.0)
    full = branches(SIXTY, 4.0, sector="full")
    assert [one[1:] for one in half] == [("out of phase", 1, 2), ("out of phase", 2, 1)]
    assert [one[0] for one in full] == pytest.approx([one[0] for one in half], abs=1e-9)
    assert [one[2:] for one in full] == [(1, 2), (2, 1)]


def test_a_pair_breaks_the_symmetry_of_a_stadium_before_it_is_folded():
    """The modes of a quarter that are odd come in pairs: the index of the full ring jumps by two.

    The path ends at pi in the planar three-covered ring, whose moment has a positive slope.
    """
    for name in ("quarter", "full"):
        found = der.fold(
            der.Scene(STADIUM, der.rectangular_section(1.5), sector=name, self_crossings=False)
        )
        gammas = [p.gamma for p in found.branches]
        assert gammas == pytest.approx([2.9703435] * len(gammas), abs=1e-7)
        assert (found.branches[0].index_before, found.branches[-1].index_after) == (0, 2)
        assert found.mode.foldable
        assert found.mode.stable
        assert not found.mode.stable_3d


# --- the estimate of the stiffness -------------------------------------------------------------


def test_stiffness_is_estimated_well_where_it_is_small():
    """The sign is that of the softest mode, and the value good to 10 % below 0.02 of torsion's.

    Truth: `softest_modes`, converged. The estimate is what three inverse iterations give.
    """
    ring = gripped_ring(SIXTY, der.rectangular_section(4.0), 64)
    torsion = (2.0 * math.pi / SIXTY.length) ** 2
    soft = 0
    for one in Request(stability=False, self_crossings=False).follow(ring):
        state = one.solution.state
        for symmetry in ring.classes:
            (exact,), _ = ring.softest_modes(state, symmetry=symmetry)
            (count,), ((estimate,),) = ring.indices(state, symmetry)
            if one.kind != "fold" and abs(exact) < 0.02 * torsion:
                assert estimate == pytest.approx(exact, rel=0.1)
                assert count == index(ring.rod, ring.supports, ring.modes[symmetry], state)
                soft += 1
    assert soft > 5


@pytest.mark.parametrize("stretching", [0.0, 1e3])
def test_modes_of_one_symmetry_do_not_hide_those_of_another(stretching):
    """Each class of the quarter has its stiffness among those of the half and of the full ring.

    In phase and out of phase, kept and reversed by an arm's own half-turn: one class of the full
    ring has four. Truth: the quarter, on which they are problems of their own.
    """
    circle, section = der.circle(natural_curvature=-1.0), der.section(1.3, 1.3)
    quarter, half, full = (
        gripped_ring(circle, section, 64, name=name, stretching=stretching)
        for name in ("quarter", "half", "full")
    )
    torsion = (2.0 * math.pi / quarter.length) ** 2
    soft = 0
    request = Request(0.6 * math.pi, stability=False, self_crossings=False)
    for one in request.follow(quarter):
        state = one.solution.state
        ((own,), (against,), (odd,)) = quarter.indices(state)[1]
        (halves, (whole,)) = (
            on.indices(lifted(quarter, state, on).state)[1] for on in (half, full)
        )
        found = [*halves[0], *halves[1], *whole]
        for value, exact in zip(found, [own, odd, against, odd] * 2, strict=True):
            if abs(exact) < 0.5 * torsion:
                assert value == pytest.approx(exact, rel=1e-2)
                soft += 1
    assert soft > 5


def test_states_of_the_half_are_those_of_the_full_ring():
    """The class indices of a half at a state add up to the index of the full ring there."""
    half, full = (
        gripped_ring(SIXTY, der.rectangular_section(4.0), 64, name=s) for s in ("half", "full")
    )
    seen = set()
    for one in Request(self_crossings=False).follow(half):
        if one.kind in ("fold", "branch"):
            continue
        counted = full.count(lifted(half, one.solution.state, full).state, "all")
        assert counted == sum(one.index)
        seen.add(counted)
    assert seen == {0, 1, 2}


# --- what lies close together -------------------------------------------------------------------


def singular(ring, h_over_t, **numerics):
    """Folds and branch points of a path, as far as it goes."""
    scene = der.Scene(ring, der.rectangular_section(h_over_t), self_crossings=False, **numerics)
    return [p for p in der.fold(scene).points if p.kind in ("fold", "branch")]


@pytest.mark.parametrize("same", [1e-6, 1e-2])
@pytest.mark.parametrize("h_over_t", [0.29, 0.2905, 0.291])
def test_a_branch_point_beside_a_fold_on_the_full_ring(h_over_t, same, monkeypatch):
    """All modes of the full ring are of one class: a fold must not hide what changes beside it.

    At kappa0 = 2 an out-of-phase mode crosses zero 4e-11 rad and less before the first fold,
    touching it at h/t = 0.291. Truth: the half, on which the two are of different classes. Places
    taken as one (``same``, of a step) share the change of the index.
    """
    ring = der.circle(natural_curvature=2.0)
    half = singular(ring, h_over_t, sector="half", gamma_max=0.3)[:2]
    monkeypatch.setattr("der.continuation.bifurcations.SAME", same)
    monkeypatch.setattr("der.continuation.events.SAME", same)
    full = singular(ring, h_over_t, sector="full", gamma_max=0.3)[:2]
    assert sorted(one.kind for one in full) == [one.kind for one in half] == ["branch", "fold"]
    assert [(one.index_before, one.index_after) for one in full] == [(16, 15), (15, 14)]
    gammas = [one.gamma for one in sorted(full, key=lambda one: one.kind)]
    assert gammas == pytest.approx([one.gamma for one in half], abs=1e-10)


@pytest.mark.parametrize("n_edges", [32, 64])
def test_a_pair_of_modes_is_one_point_on_the_full_ring(n_edges):
    """Modes odd on each arm cross zero together: one point whose index changes by two.

    On the half it is one of each class, in their order. Gamma is that of the quarter, whose own
    equations are not singular there: measured 2e-12 (1e-10, and up to four points on the full
    ring, when states were solved for right next to the point).
    """
    circle, wants = der.circle(), {"n_edges": n_edges, "until": "folded"}
    quarter, half, full = (
        [one for one in singular(circle, 1.0, sector=name, **wants) if one.kind == "branch"]
        for name in ("quarter", "half", "full")
    )
    steps = [(one.index_before, one.index_after) for one in quarter]
    assert steps == [(1, 3), (3, 1), (1, 3)]
    assert [(one.index_before, one.index_after) for one in full] == steps
    assert [one.details["symmetry"] for one in half] == ["in phase", "out of phase"] * 3
    assert [one.index_before for one in half] == [1, 2, 3, 2, 1, 2]
    assert [one.index_after for one in half] == [2, 3, 2, 1, 2, 3]
    for found in (full, half[::2], half[1::2]):
        assert [a.gamma for a in found] == pytest.approx([b.gamma for b in quarter], abs=1e-10)


@pytest.mark.parametrize(
    ("ring", "h_over_t", "name", "kinds"),
    [
        (der.circle(natural_curvature=2.0), 0.29, "full", {"branch", "fold"}),
        (der.circle(), 1.6, "full", {"fold"}),
        (SIXTY, 4.0, "full", {"branch", "fold"}),
    ],
)
def test_a_fold_is_told_from_a_branch_point(ring, h_over_t, name, kinds):
    """By the root of dgamma/dM, which is of no scale, also where the place is 1e-9 of s off."""
    gripped = gripped_ring(ring, der.rectangular_section(h_over_t), 64, name=name)
    found = list(Request(targets=(), self_crossings=False).follow(gripped))
    seen = set()
    for k, one in enumerate(found):
        if one.kind not in ("fold", "branch"):
            continue
        a, b = (next(v for v in side if not v.kind) for side in (found[k::-1], found[k:]))
        step = step_between(gripped, a, b)
        away = gripped.difference(a.solution.state, one.solution.state)
        s = gripped.inner(a.solution.tangent, away)
        for off in (-1e-9, 0.0, 1e-9):
            assert is_fold(step, s + off) == (one.kind == "fold")
        seen.add(one.kind)
    assert seen == kinds


class Leap:
    """A step on which a value falls, but for a leap at s = 0.37 within 1e-6."""

    def __init__(self, height: float) -> None:
        self.height = height

    def at(self, s: float) -> tuple[float, float]:
        """Return the value at ``s`` and its rate."""
        u = (s - 0.37) / 1e-6
        rate = self.height / 1e-6 / math.cosh(u) ** 2 if abs(u) < 300.0 else 0.0
        return -s + self.height * math.tanh(u), -1.0 + rate


@pytest.mark.parametrize(("height", "turns"), [(2.0, 2), (0.6, 2), (0.0, 0)])
def test_a_leap_against_the_rates_at_both_ends_is_found(height, turns):
    """If a value changes against its rates, it has turned twice in between (mean value theorem)."""
    step = Leap(height)
    ends = [(s, step.at(s)) for s in (0.0, 1.0)]
    rates = [rate for _, (_, rate) in _bisected(step, ends, lambda at: at)]
    assert sum(a * b < 0.0 for a, b in pairwise(rates)) == turns
