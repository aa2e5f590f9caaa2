"""States of a ring: deflation, images, the record, the picture and the command."""

import json
import math
import signal
from dataclasses import replace

import numpy as np
import pytest

import der
from der.analysis.multistability.deflation import factor, recognised, solved
from der.analysis.multistability.descriptors import needs_cut, turning
from der.analysis.multistability.initial_guesses import covered, eight
from der.analysis.multistability.symmetry_images import Images, curvatures, images, repeats
from der.cli.commands import main
from der.records.states import RingState, States, Transition
from der.rod.free_ring import balance
from der.rod.gripped_ring import free_supports, gripped_ring
from der.rod.rod import discrete_rod
from der.viz.plots.arrows import arc, bends, label_places
from der.viz.plots.states import draw
from der.viz.plots.style import save

BAR = der.rectangular_section(2.0)


# --- Deflation -------------------------------------------------------------------------------


def roots(step, start, most, rounds=200):
    """Roots that Newton's method with deflation finds one after the other from one start."""
    known = []
    for _ in range(most):
        x = np.array(start, dtype=float)
        for _ in range(rounds):
            d = step(x)
            tau = 1.0
            if known:
                tau = factor(
                    lambda t, x=x, d=d: np.linalg.norm(x + t * d - np.array(known), axis=1),
                )
            size = np.linalg.norm(d)
            x = x + np.clip(tau, -1.0 / max(size, 1e-300), 1.0 / max(size, 1e-300)) * d
            if size < 1e-13:
                break
        else:
            return known
        known.append(x)
    return known


def test_deflation_finds_all_roots_of_a_cubic_from_one_start():
    """(x - 1)(x - 2)(x - 4) from 1.2, where Newton's method alone always goes to 1."""
    p = np.polynomial.Polynomial.fromroots([1.0, 2.0, 4.0])
    slope = p.deriv()
    found = roots(lambda x: -p(x) / slope(x), [1.2], 3)
    np.testing.assert_allclose(np.sort(np.concatenate(found)), [1.0, 2.0, 4.0], atol=1e-12)


def test_deflation_finds_all_intersections_of_a_circle_and_a_hyperbola():
    """x^2 + y^2 = 4 and x y = 1 meet in four points: (x + y)^2 = 6, (x - y)^2 = 2."""

    def step(x):
        F = np.array([x @ x - 4.0, x[0] * x[1] - 1.0])
        return -np.linalg.solve(np.array([[2 * x[0], 2 * x[1]], [x[1], x[0]]]), F)

    found = roots(step, [1.0, 0.3], 4)
    a, b = math.sqrt(6.0), math.sqrt(2.0)
    exact = [((s * a + t * b) / 2, (s * a - t * b) / 2) for s in (1, -1) for t in (1, -1)]
    np.testing.assert_allclose(sorted(map(tuple, found)), sorted(exact), atol=1e-12)


def test_deflation_throws_a_step_towards_a_known_state_back():
    """On the way to a known state slope is 2 and tau -1, far from all it is Newton's own step."""
    near = factor(lambda t: np.array([1e-3 * (1.0 - t)]))
    far = factor(lambda t: np.array([1e3 - t]))
    assert near == pytest.approx(-1.0, rel=1e-2)
    assert far == pytest.approx(1.0, abs=1e-6)


# --- Images ----------------------------------------------------------------------------------


def wavy(n, seed=3, shift=0.0):
    """Smooth curvatures without any symmetry."""
    random = np.random.default_rng(seed)
    s = 2.0 * np.pi * (np.arange(n) + 0.5) / n + shift
    waves = [a * np.cos(m * s + p) for m in range(4) for a, p in random.normal(size=(3, 2))]
    return np.sum(np.array(waves).reshape(4, 3, n), axis=0).T


def ways(ring, bar=BAR, n_edges=32, **grips):
    """The images of a ring, free, or in its grips turned to gamma."""
    full = gripped_ring(ring, bar, n_edges, name="full")
    if "gamma" in grips:
        return images(full.rod, full.supports, grips["gamma"])
    return images(full.rod, free_supports(full.rod), 0.0)


def apart(ways: Images, a, b):
    """The distance between two shapes and all images."""
    return float(ways.distances(ways.signature(a), ways.all_of(b)).min())


def test_a_uniform_ring_does_not_feel_a_shift_of_its_material():
    """Nor one by part of a cell; a difference that no shift can mend is its mean square."""
    free = ways(der.circle())
    k = wavy(32)
    assert apart(free, k, wavy(32, shift=0.123)) < 1e-12
    other = k.copy()
    other[:, 0] += 0.25
    assert apart(free, k, other) == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize(
    ("ring", "gamma", "count"),
    [
        (der.circle(), None, 4),  # mirror and reversal
        (der.circle(0.0), None, 8),  # and half a roll of a straight bar
        (der.circle(), 0.0, 8),  # and half the length: the grips change places
        (der.circle(), 1.0, 4),  # where the mirror would turn the grips back
        (der.ellipse(0.6), None, 8),
        (der.triangle(math.pi / 3, 0.2), None, 4),
        (der.triangle(math.pi / 3, 0.2), 1.0, 1),
    ],
    ids=str,
)
def test_shapes_come_in_as_many_images_as_the_ring_allows(ring, gamma, count):
    """The group order, counted; every image is as far from all as the shape itself: not at all."""
    if ring.shape == "triangle" and gamma is not None:
        count = 2  # run backwards about its axis
    own = ways(ring) if gamma is None else ways(ring, gamma=gamma)
    k = wavy(32)
    assert len(own.all_of(k)) == count
    for move in own.moves:
        assert apart(own, move.of(k), k) < 1e-12


def test_a_round_straight_bar_may_be_rolled_by_any_angle():
    """k1 + i k2 times a constant of modulus 1 is the same state of an isotropic straight rod."""
    free = ways(der.circle(0.0), der.section(1.3, 1.3))
    k = wavy(32)
    z = (k[:, 0] + 1j * k[:, 1]) * np.exp(0.7j)
    assert apart(free, k, np.stack([z.real, z.imag, k[:, 2]], axis=1)) < 1e-12
    assert apart(free, k, np.stack([z.real, z.imag, -k[:, 2]], axis=1)) > 0.1


def test_repeats_are_counted():
    """A curve of period L/3 repeats itself three times, a constant one has no number."""
    k = wavy(32)
    assert repeats(k) == 1
    assert repeats(np.tile(wavy(32), (3, 1))) == 3
    assert repeats(np.ones((32, 3))) == 0


def test_curvatures_do_not_change_in_rigid_motions():
    """All frames turned alike."""
    full = gripped_ring(der.ellipse(0.6), BAR, 32, name="full")
    state = full.start
    q = np.array([0.5, -0.1, 0.7, np.sqrt(1.0 - 0.25 - 0.01 - 0.49)])
    a, b = q[0], q[1:]
    p, v = state.quat[:, :1], state.quat[:, 1:]
    turned = np.hstack([a * p - v @ b[:, None], a * v + p * b + np.cross(b, v)])
    np.testing.assert_allclose(
        curvatures(full.rod, state), curvatures(full.rod, state.but(quat=turned)), atol=1e-13
    )


# --- States ----------------------------------------------------------------------------------


def test_a_solved_state_is_known_again_wherever_its_material_is():
    """The figure eight, its material moved on by five cells and its frames mirrored."""
    full = gripped_ring(der.circle(0.5), BAR, 32, name="full")
    one = solved(eight(full), ways(der.circle(0.5)))
    quat = np.roll(one.free.state.quat, 5, axis=0) * [1.0, 1.0, -1.0, -1.0]
    again = solved(balance(full.rod, quat, np.zeros(32)), ways(der.circle(0.5)))
    flat = solved(covered(full, 1), ways(der.circle(0.5)))
    assert recognised(again, [flat, one], ways(der.circle(0.5))) == 1
    assert again.energy == pytest.approx(one.energy, abs=1e-11)


@pytest.mark.parametrize("turns", [1, 2, 3, 4])
def test_even_covers_need_a_cut(turns):
    """pi_1(SO(3)) has two elements: turns by 2 pi n are one or the other by the parity of n."""
    full = gripped_ring(der.circle(), BAR, 32, name="full")
    state = covered(full, turns).state
    assert needs_cut(state.quat) is (turns % 2 == 0)
    assert turning(full, state) == turns
    assert turning(full, covered(full, turns, math.pi).state) == -turns


def test_a_round_straight_ring_spins_at_no_cost():
    """Isotropic and naturally straight: the seventh zero mode, and none in the way of the index."""
    n = 32
    rod = discrete_rod(np.full(n, 2 * np.pi / n), np.zeros(n), (1.0, 1.0, 1.0), closed=True)
    angle = np.pi * np.arange(n) / n
    quat = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=1)
    round_one = balance(rod, quat, np.zeros(n))
    assert round_one.zero_modes == 1
    assert round_one.index() == 0
    flat = discrete_rod(np.full(n, 2 * np.pi / n), np.zeros(n), (1.0, 1.5, 1.0), closed=True)
    assert balance(flat, quat, np.zeros(n)).zero_modes == 0


def few(**options):
    """A quick search."""
    return der.states(der.Scene(der.circle(), BAR, n_edges=32), **{"count": 3} | options)


def test_ctrl_c_keeps_what_was_found():
    """Pressed after the second state."""
    found = few(count=8, progress=lambda n: n == 2 and signal.raise_signal(signal.SIGINT))
    assert found.status == "interrupted"
    assert [state.name for state in found.states] == ["flat", "two-covered"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gamma": -0.1}, "gamma must be a number from 0 to 2 pi, got -0.1"),
        ({"gamma": math.nan}, "gamma must be a number from 0 to 2 pi, got nan"),
        ({"count": 0}, "count must be an integer from 1 to 200, got 0"),
        ({"count": 2.0}, "count must be an integer from 1 to 200, got 2.0"),
    ],
)
def test_bad_input_is_named(options, message):
    with pytest.raises(ValueError, match=message):
        few(**options)


def test_too_many_edges_are_refused():
    with pytest.raises(ValueError, match="n_edges must be at most 1024 here, got 2048"):
        der.states(der.Scene(der.circle(), BAR, n_edges=2048))
    with pytest.raises(ValueError, match=r"scene must be a der\.Scene"):
        der.states(None)


# --- The record ------------------------------------------------------------------------------


def sample(**changes):
    """A record made up."""
    rows = [
        ("flat", 0.0, 0, 1, False),
        ("figure eight", 9.0, 1, 0, True),
        ("saddle 1", 10.0, None, None, True),
    ]
    states = tuple(
        RingState(name, u, i, 1e-12, c is not None, c, None, None, 0.0, cut, 1, 1, 0)
        for name, u, i, c, cut in rows
    )
    falls = (
        Transition("figure eight", "flat", -1.0, 1, ("saddle 1",), 9.0),
        Transition("figure eight", None, -1.0, -1, (), None),
    )
    scene = der.Scene(der.circle(), BAR)
    given = {"gamma": None, "states": states, "transitions": falls, "tried": 5, "nowhere": 2}
    about = {"ring": scene.ring.to_json(), "section": vars(BAR), "numerics": {"n_edges": 64}}
    return States(**about | given | {"peaks": 1} | changes)


def test_the_record_comes_back_as_it_was(tmp_path):
    """Through JSON and a file."""
    one = sample()
    one.save(tmp_path / "states.json")
    again = States.load(tmp_path / "states.json")
    assert again.to_json() == one.to_json()
    assert again.states == one.states
    assert again.transitions == one.transitions
    assert again["figure eight"].index == 1
    assert again.falls_to("figure eight") == ("flat",)
    assert [state.name for state in again.minima] == ["flat"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e.update(schema=2), "schema is 2, this version reads 1"),
        (lambda e: e.pop("gamma"), "gamma is missing"),
        (lambda e: e["states"][0].update(energy="low"), r"states\[0\].energy must be a finite"),
        (lambda e: e["states"][0].update(index=-1), r"states\[0\].index must be an integer"),
        (lambda e: e["states"][0].pop("name"), r"states\[0\].name is missing"),
        (lambda e: e["states"][1].update(name="flat"), "names of their own"),
        (lambda e: e["transitions"][0].update(end="nowhere"), "between states, got 'nowhere'"),
        (lambda e: e.update(status="lost"), "status must be one of done"),
    ],
)
def test_a_broken_record_is_refused(change, message):
    entries = json.loads(sample().to_json())
    change(entries)
    with pytest.raises(ValueError, match=message):
        States.from_json(json.dumps(entries))


def test_a_record_of_another_kind_is_named():
    """Its kind, and not its content."""
    text = sample().to_json()
    for old, new, message in (
        ('"kind": "states"', '"kind": "push"', "^kind is 'push', not 'states'$"),
        ('"kind": "states",', "", "^not a record of states$"),
    ):
        with pytest.raises(ValueError, match=message):
            States.from_json(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=r"^not a path but a record of kind 'states'$"):
        der.Path.from_json(text)


def test_states_are_short_in_print():
    """Not all their numbers."""
    assert repr(sample()) == "States(circle, free, 3 states, 1 minima, done)"


def test_rounding_is_not_printed():
    """Zeros have no sign; heads and footnotes say what is meant."""
    from der.records.text import summary

    flat = RingState("flat", -6e-16, 0, 1e-12, True, 1, 0, 0.0, 0.0, False, 1, 1, 0, -2e-15, 2.0)
    said = summary(sample(gamma=0.0, states=(flat,), transitions=()))
    assert "distance a" in said
    assert "-0.0" not in said
    assert "link: " in said


def test_a_file_that_is_no_record_is_named(tmp_path):
    (tmp_path / "x.json").write_text("{")
    with pytest.raises(ValueError, match=r"x\.json: not JSON"):
        States.load(tmp_path / "x.json")


# --- Picture and command ---------------------------------------------------------------------


def test_every_state_and_fall_is_drawn():
    """A name above each column, a node with the index, an arrow for each pair, with its energy."""
    row, graph = draw(sample()).axes
    assert [t.get_text() for t in row.texts][::2] == ["flat", "figure eight", "saddle 1"]
    assert [t.get_text() for t in graph.texts] == ["9.00", "0", "1", "?"]
    assert len(graph.patches) == 1
    with pytest.raises(ValueError, match="at least one"):
        draw(sample(states=(), transitions=()))
    with pytest.raises(ValueError, match="plot must end in"):
        save(draw(sample()), "states.txt")


def test_the_legend_fits_whatever_there_is():
    """On a narrow page in several rows, nothing beyond the edges."""
    figure = draw(sample())
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.width


def test_the_axis_of_one_state_begins_at_a_ring_without_strain():
    """Else a single level would stand on an axis of no meaning."""
    single = replace(sample().states[1], energy=8.0)
    graph = draw(sample(states=(single,), transitions=(), gamma=1.0)).axes[1]
    assert graph.get_ylim()[0] < 0.0 < 8.0 < graph.get_ylim()[1]
    title = draw(sample(gamma=1.0)).texts[0].get_text()
    assert title.endswith("= 1 rad")


def test_arrows_go_around_other_points():
    """The straight way from the third to the first would pass through the second."""
    points = np.array([[0.0, 0.0], [100.0, 100.0], [200.0, 200.0]])
    box = (np.array([-50.0, -50.0]), np.array([250.0, 250.0]))
    (rad,) = bends(points, [(2, 0)], 20.0, box)
    way = arc(points[2], points[0], rad, np.linspace(0.0, 1.0, 200))
    assert np.linalg.norm(way - points[1], axis=1).min() > 19.0
    np.testing.assert_allclose(way[[0, -1]], points[[2, 0]])


def test_arrows_between_the_same_points_do_not_coincide():
    """There and back: two ways, and two labels that do not lie on each other."""
    points = np.array([[0.0, 0.0], [300.0, 30.0]])
    box = (np.array([-50.0, -150.0]), np.array([350.0, 150.0]))
    pairs = [(0, 1), (1, 0)]
    t = np.linspace(0.0, 1.0, 61)
    ways = [
        arc(points[a], points[b], rad, t)
        for (a, b), rad in zip(pairs, bends(points, pairs, 20.0, box), strict=True)
    ]
    assert np.linalg.norm(ways[0] - ways[1][::-1], axis=1).max() > 20.0
    half = [np.array([20.0, 8.0])] * 2
    one, other = label_places(points, ways, half, 10.0)
    assert np.any(np.abs(one - other) > (40.0, 16.0))


def command(capsys, *words):
    """Exit code, standard output and error of `der states`."""
    with pytest.raises(SystemExit) as left:
        main(["states", "circle", "--h-over-t", "2", *map(str, words)])
    return left.value.code, *capsys.readouterr()


def test_the_command_writes_record_shapes_and_picture(capsys, tmp_path):
    """And says in a table what stays and what falls where."""
    code, out, err = command(capsys, "--edges", 32, "--count", 4, "--out", tmp_path)
    found = States.load(tmp_path / "states.json")
    assert (code, err) == (0, "")
    assert "two-covered" in out
    assert "stays" in out
    assert len(np.load(tmp_path / "shapes.npz")["x"]) == len(found)
    assert (tmp_path / "states.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("status", "code"), [("interrupted", 130), ("not converged", 3)])
def test_an_unfinished_search_is_saved(capsys, tmp_path, monkeypatch, status, code):
    """Where no file was named as well, and where is said in one line."""
    monkeypatch.chdir(tmp_path)
    unfinished = sample(status=status, message="why")
    monkeypatch.setattr("der.states", lambda *scene, **options: unfinished)
    got, out, err = command(capsys, "--quiet")
    assert (got, out) == (code, "")
    assert err == "der: why; states that were found: 3, in der-unfinished.json\n"
    assert States.load("der-unfinished.json").status == status


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--gamma", "7"), "der: --gamma must be a number from 0 to 2 pi, got 7.0"),
        (("--count", "0"), "der: --count must be an integer from 1 to 200, got 0"),
        (("--edges", "30"), "der: --edges must be divisible by 4, as the path of twisting"),
        (("--edges", "2048"), "der: --edges must be at most 1024"),
        (("--plot", "x.txt"), "der: --plot must end in"),
    ],
)
def test_the_command_names_the_option(capsys, words, message):
    code, out, err = command(capsys, *words)
    assert code == 2
    assert out == ""
    assert err.startswith(message)
    assert err.count("\n") == 1
