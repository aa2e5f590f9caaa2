"""The scene refuses, by name, what cannot be solved, and keeps what it is given."""

import dataclasses
import math

import numpy as np
import pytest

import der
from der.scene import COPIES, CROSSINGS_UP_TO, MEASURES, Scene, sector_name

SECTION = der.rectangular_section(4.0)


def scene(**wants):
    return Scene(der.circle(), SECTION, **wants)


# --- Defaults --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_edges", 64),
        ("sector", "auto"),
        ("stability", True),
        ("self_crossings", None),
        ("shapes", False),
        ("history", False),
        ("modes", False),
        ("gamma_max", math.pi),
        ("until", None),
        ("save_at", None),
        ("curvature", "logarithm"),
        ("stretch", "inextensible"),
        ("a_over_t", 200.0),
        ("tolerance", 1e-10),
    ],
)
def test_defaults(name, value):
    """Those of "The front door"."""
    assert getattr(scene(), name) == value


def test_wants_are_given_by_name():
    """Only ring and section have places: Scene(ring, section, 64) would hide what 64 is."""
    with pytest.raises(TypeError, match="positional"):
        Scene(der.circle(), SECTION, 64)


def test_a_scene_is_not_changed_after_its_checks():
    """Frozen: a checked scene stays checked."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene().n_edges = 7


def test_equal_statements_are_equal_scenes():
    """And the order of save_at does not matter."""
    assert scene(save_at=[1.0, 0.5]) == scene(save_at=(0.5, 1.0))


# --- Refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gamma_max", "a_over_t", "tolerance"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, -math.inf, True, "1", None, 1j, [1]])
def test_numbers_are_finite_and_positive(name, value):
    """The message starts with the argument; a bool and a string are no numbers."""
    with pytest.raises(ValueError, match=rf"^{name} must be a finite number > 0, got ") as wrong:
        scene(**{name: value})
    assert str(wrong.value).endswith(repr(value))


@pytest.mark.parametrize(
    ("name", "allowed"),
    [
        ("curvature", "logarithm, angle, tangent"),
        ("stretch", "inextensible, finite"),
        ("until", "folded"),
        ("sector", "auto, full, half, quarter"),
    ],
)
@pytest.mark.parametrize("value", ["third", "", "AUTO", True, 1, ["auto"]])
def test_words_are_from_a_list(name, allowed, value):
    """The message has the argument, what is allowed and the value."""
    with pytest.raises(ValueError, match=rf"^{name} must be one of {allowed}, got ") as wrong:
        scene(**{name: value})
    assert str(wrong.value).endswith(repr(value))


@pytest.mark.parametrize("name", ["curvature", "stretch", "sector"])
def test_words_must_be_given(name):
    """None is a value only where it means something."""
    with pytest.raises(ValueError, match=f"^{name} must be one of .*, got None"):
        scene(**{name: None})


@pytest.mark.parametrize("value", [64.0, "64", True, None, math.nan])
def test_edges_are_a_whole_number(value):
    """Not a float that happens to be whole."""
    with pytest.raises(ValueError, match=r"^n_edges must be an integer, got "):
        scene(n_edges=value)


def test_a_finest_mesh_has_the_frames_of_the_others():
    """Else no other mesh could have its frames among them."""
    assert scene(n_edges=16, finest=64).finest == 64
    with pytest.raises(ValueError, match=r"^finest must be a multiple of 16, got 40$"):
        scene(n_edges=16, finest=40)


@pytest.mark.parametrize(
    ("n_edges", "sector", "divisor"),
    [
        (66, "auto", 4),
        (66, "quarter", 4),
        (65, "full", 2),
        (65, "half", 2),
        (4, "auto", 4),
        (6, "full", 2),
        (0, "full", 2),
        (-64, "full", 2),
        (65_540, "auto", 4),
    ],
)
def test_edges_divide_into_the_sector(n_edges, sector, divisor):
    """Even; by 4 for a quarter; from 8 to 65,536."""
    allowed = f"from 8 to 65536 and divisible by {divisor}"
    with pytest.raises(ValueError, match=f"^n_edges must be {allowed} .*, got {n_edges}$"):
        scene(n_edges=n_edges, sector=sector)


@pytest.mark.parametrize(
    ("n_edges", "sector"),
    [(8, "auto"), (10, "half"), (10, "full"), (65_536, "quarter")],
)
def test_fewest_and_most_edges(n_edges, sector):
    """The ends of the allowed range are allowed."""
    assert scene(n_edges=n_edges, sector=sector).n_edges == n_edges


@pytest.mark.parametrize("value", [None, "circle", der.circle, SECTION])
def test_ring_must_be_a_ring(value):
    """Named, with an example."""
    with pytest.raises(ValueError, match=r"^ring must be a der\.Ring such as der\.circle\(\), got"):
        Scene(value, SECTION)


@pytest.mark.parametrize("value", [None, 4.0, der.section])
def test_section_must_be_a_section(value):
    """Named, with an example."""
    with pytest.raises(ValueError, match=r"^section must be a der\.Section such as .*, got"):
        Scene(der.circle(), value)


def test_tolerance_is_not_too_coarse():
    """Above 1e-4 an equilibrium would not be one."""
    with pytest.raises(ValueError, match=r"^tolerance must be at most 1e-4, got 0\.001$"):
        scene(tolerance=1e-3)


def test_coarsest_tolerance():
    """The limit itself is allowed."""
    assert scene(tolerance=1e-4).tolerance == 1e-4


@pytest.mark.parametrize("value", [-0.1, 3.2, math.nan, math.inf, True, "1", None])
def test_saved_gammas_lie_on_the_path(value):
    """From 0 to gamma_max; one bad entry is enough."""
    with pytest.raises(ValueError, match=r"^save_at must be numbers from 0 to gamma_max = 3\.14"):
        scene(save_at=[0.5, value])


def test_saved_gammas_end_at_gamma_max():
    """The path does not go on for them."""
    with pytest.raises(ValueError, match=r"gamma_max = 1\.0, got 1\.5$"):
        scene(gamma_max=1.0, save_at=[1.5])


def test_saved_gammas_may_exceed_pi_where_the_path_does():
    """Until folded, the path goes beyond pi by itself."""
    assert scene(until="folded", save_at=[5.0]).save_at == (5.0,)


def test_a_quarter_needs_two_mirrors():
    """A triangle's twist keeps one half-turn only."""
    with pytest.raises(ValueError, match=r"^sector must be .* for a triangle, got 'quarter'"):
        Scene(der.triangle(math.radians(60), 0.1), SECTION, sector="quarter")


def test_a_slenderness_beyond_floats_is_refused():
    """EA = 12 alpha (a/t)^2 has to be a finite number as well."""
    with pytest.raises(ValueError, match=r"^a_over_t must be .*, got 1e\+300"):
        assert math.isfinite(scene(stretch="finite", a_over_t=1e300).stretching)


def test_one_saved_gamma_is_a_list_of_one():
    """A lone number is refused by name."""
    with pytest.raises(ValueError, match=r"^save_at must be .*, got 0\.5"):
        scene(save_at=0.5)


@pytest.mark.parametrize("name", ["stability", "self_crossings", "shapes", "history", "modes"])
def test_switches_are_true_or_false(name):
    """A text such as "no" is true in Python."""
    with pytest.raises(ValueError, match=rf"^{name} must be true or false, got 'no'"):
        scene(**{name: "no"})


@pytest.mark.parametrize("name", ["history", "modes"])
def test_what_goes_with_shapes_is_refused_without(name):
    """It would be computed and thrown away."""
    with pytest.raises(ValueError, match=f"^{name} must come with shapes, got shapes=False"):
        scene(**{name: True})


def test_modes_are_refused_where_there_is_no_hessian():
    """As by dynamic relaxation alone."""
    with pytest.raises(
        ValueError, match=r"^modes must come with solver 'newton', got 'relaxation'"
    ):
        scene(control="angle", solver="relaxation", shapes=True, modes=True)


# --- What is kept ----------------------------------------------------------------------------


def test_saved_gammas_are_sorted_and_each_there_once():
    """In whatever order they were asked for."""
    assert scene(save_at=[2.0, 0.5, 2.0, 1]).save_at == (0.5, 1.0, 2.0)


def test_saved_gammas_may_be_none_at_all():
    """An empty list is not the default list."""
    assert scene(save_at=[]).save_at == ()


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, int])
def test_numpy_numbers_are_numbers(kind):
    """What a loop over an array hands out is taken."""
    given = scene(gamma_max=kind(2), a_over_t=kind(100), save_at=[kind(1)])
    assert (given.gamma_max, given.a_over_t, given.save_at) == (2.0, 100.0, (1.0,))


def test_numpy_edges_are_a_whole_number():
    """As in `for n in 2 ** np.arange(5, 9)`."""
    assert scene(n_edges=np.int64(32)).n_edges == 32


def test_saved_gammas_may_be_an_array():
    """np.linspace is the way to write such a list."""
    assert scene(save_at=np.linspace(0.0, 1.0, 3)).save_at == (0.0, 0.5, 1.0)


@pytest.mark.parametrize(("ring", "name"), [(der.circle(), "quarter"),
                                            (der.triangle(1.0, 0.1), "half")])  # fmt: skip
def test_auto_is_the_smallest_sector(ring, name):
    """A quarter where the ring has two mirrors, else half."""
    assert sector_name(ring, "auto", 64) == name


def test_copies_make_the_ring():
    """A sector's name says its part of the ring."""
    assert COPIES == {"full": 1, "half": 2, "quarter": 4}


@pytest.mark.parametrize("measure", MEASURES)
def test_every_measure_is_accepted(measure):
    """As it is listed."""
    assert scene(curvature=measure).curvature == measure


def test_stretching_of_a_rectangle():
    """EA a^2/GJ = 12 alpha (a/t)^2, since EI1 = EA t^2/12."""
    assert scene(stretch="finite", a_over_t=10.0).stretching == 1200.0 * SECTION.alpha


def test_an_inextensible_ring_has_no_stretching():
    """Zero stands for infinite EA, whatever a/t is."""
    assert scene(a_over_t=10.0).stretching == 0.0


@pytest.mark.parametrize(
    ("wants", "looks"),
    [
        ({"n_edges": CROSSINGS_UP_TO}, True),
        ({"n_edges": CROSSINGS_UP_TO + 4}, False),
        ({"n_edges": CROSSINGS_UP_TO + 4, "self_crossings": True}, True),
        ({"self_crossings": False}, False),
    ],
)
def test_self_crossings_are_looked_for_while_it_is_cheap(wants, looks):
    """The writhe costs O(N^2), so by default up to 1024 edges."""
    assert scene(**wants).looks_for_self_crossings is looks


def test_the_old_name_of_self_crossings_is_accepted_with_a_warning():
    """In the constructor, in `replace`, and as an attribute."""
    with pytest.warns(DeprecationWarning, match="self_crossings"):
        old = scene(contacts=False)
    assert old == scene(self_crossings=False)
    with pytest.warns(DeprecationWarning, match="self_crossings"):
        assert dataclasses.replace(scene(), contacts=True).self_crossings is True
    with pytest.warns(DeprecationWarning, match="self_crossings"):
        assert old.contacts is False


@pytest.mark.parametrize(("degrees", "radians"), [(180, "3.141592654"), (720.0, "12.56637061")])
def test_gamma_max_in_degrees_is_refused_with_a_hint(degrees, radians):
    """A slip that cost a path to -78 rad."""
    hint = rf"degrees are {radians}\), got {degrees}"
    words = rf"^gamma_max must be at most 10 pi, in radians .* {hint}"
    with pytest.raises(ValueError, match=words):
        scene(gamma_max=degrees)
