"""Numbers with units: how they are read, and the way from non-dimensional numbers back."""

import math

import pytest

import der
from der.geometry.scale import FORCES, LENGTHS, STRESSES, Scale, dimensional, quantity
from der.geometry.section import rectangular_section

GIVEN = {"young": "3.5GPa", "height": "10 mm", "thickness": "1mm", "size": "10 cm", "nu": 0.35}


def test_scale_of_a_square_bar():
    """J = 0.1405770 h^4 for a square (Timoshenko and Goodier); G = E/2.6."""
    scale = Scale.of(young_modulus=2.6e9, nu=0.3, h=1e-3, t=1e-3, a=0.2)
    assert scale.moment == pytest.approx(1e9 * 0.1405770e-12 / 0.2, rel=1e-6)


def test_scale_and_section_agree_on_torsion():
    """EI1 = alpha GJ: Eq. (A.8) and Eq. (A.16) are one formula."""
    E, h, t, a = 1.8e9, 4e-3, 1e-3, 0.2
    GJ = Scale.of(E, 0.3, h, t, a).moment * a
    assert rectangular_section(h / t).alpha * GJ == pytest.approx(E * h * t**3 / 12, rel=1e-14)


def test_units_are_consistent():
    """Energy = moment x rad = force x length."""
    scale = Scale.of(1.8e9, 0.3, 4e-3, 1e-3, 0.2)
    assert (scale.energy, scale.force * scale.length) == pytest.approx((scale.moment,) * 2)


def test_scale_does_not_tell_height_from_thickness():
    """GJ is the same for (h, t) and (t, h)."""
    assert Scale.of(1e9, 0.3, 1e-3, 4e-3, 0.2) == Scale.of(1e9, 0.3, 4e-3, 1e-3, 0.2)


@pytest.mark.parametrize(
    ("text", "units", "value"),
    [
        ("3.5GPa", STRESSES, 3.5e9),
        (" 3.5 GPa ", STRESSES, 3.5e9),
        ("+2.1e5MPa", STRESSES, 2.1e11),
        (".5 psi", STRESSES, 3447.378646584),
        ("10mm", LENGTHS, 0.01),
        ("100 \u00b5m", LENGTHS, 1e-4),
        ("100 \u03bcm", LENGTHS, 1e-4),
        ("2in", LENGTHS, 0.0508),
        ("1lbf", FORCES, 4.4482216152605),
    ],
)
def test_a_number_with_its_unit_is_read_in_si(text, units, value):
    """The inch and the pound-force are exact by definition; both signs for micro are known."""
    assert quantity("x", text, units, "1") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "value",
    [
        *("3.5", "GPa", "", "3.5 gpa", "3.5 G Pa", "3,5GPa", "-1GPa", "0GPa", "1e400GPa"),
        *("nan GPa", "inf GPa", "1 m", "3.5GPa 2", 3.5, None, True),
    ],
)
def test_anything_else_is_refused_with_an_example(value):
    """A plain number is no stress; the message names argument, units, an example and the value."""
    with pytest.raises(ValueError, match="young must be a number > 0 with its unit") as error:
        quantity("young", value, STRESSES, "3.5GPa")
    for part in ("Pa, kPa, MPa, GPa, psi", "such as 3.5GPa", repr(value).strip("'")):
        assert part in str(error.value)


def test_a_bar_gives_section_scale_and_slenderness():
    """E, h, t and a: the section of h/t and nu, a/t, and GJ of Eq. (A.8)."""
    made = dimensional(**GIVEN)
    assert made["section"].alpha == pytest.approx(rectangular_section(10, 0.35).alpha, rel=1e-14)
    assert made["a_over_t"] == pytest.approx(100.0, rel=1e-14)
    scale = made["scale"]
    assert (scale.a, scale.units) == (pytest.approx(0.1, rel=1e-15), "N,m")
    EI1 = 3.5e9 * 0.01 * 0.001**3 / 12  # bending in the plane of the ring: about the height
    assert made["section"].alpha * scale.GJ == pytest.approx(EI1, rel=1e-13)


def test_a_scene_is_made_of_a_bar():
    """The scene keeps what the bar gives."""
    scene = der.Scene(der.circle(), **dimensional(**GIVEN, units="N,mm"))
    assert scene.scale == Scale(0.1, scale_of_bar().GJ, "N,mm")
    assert scene.a_over_t == pytest.approx(100.0)


def scale_of_bar():
    return Scale.of(3.5e9, 0.35, 0.01, 0.001, 0.1)


@pytest.mark.parametrize(
    ("units", "quantity", "factor", "name"),
    [
        ("N,m", "moment", 0.02, "N m"),
        ("N,m", "energy", 0.02, "J"),
        ("N,mm", "moment", 20.0, "N mm"),
        ("N, mm", "energy", 20.0, "N mm"),
        ("mN,mm", "moment", 2e4, "mN mm"),
        ("kN,cm", "force", 2e-4, "kN"),
        ("N,mm", "length", 100.0, "mm"),
        ("lbf,in", "length", 0.1 / 0.0254, "in"),
    ],
)
def test_what_is_shown_is_in_the_units_asked_for(units, quantity, factor, name):
    """GJ/a, GJ/a^2 and a of a = 0.1 m and GJ = 0.002 N m^2, by hand."""
    number, unit = Scale(0.1, 0.002, units).unit(quantity)
    assert (number, unit) == (pytest.approx(factor, rel=1e-14), name)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scale.of(0, 0.3, 1, 1, 1), "young_modulus must be a finite number > 0, got 0"),
        (lambda: Scale.of(1, 0.3, 1, 1, math.nan), "a must be a finite number > 0, got nan"),
        (lambda: Scale.of(1, 0.3, 1, 1e-200, 1), "GJ must be a finite number > 0, got 0.0"),
        (lambda: Scale.of(1, 0.3, 1e200, 1e200, 1), "GJ must be a finite number > 0, got inf"),
        (lambda: dimensional(**GIVEN | {"height": "1e300m"}), "height over thickness is too"),
        (lambda: Scale(0.0, 1.0), "a must be a finite number > 0, got 0.0"),
        (lambda: Scale(1e-200, 1e200), "moment must be a finite number > 0, got inf"),
        (lambda: Scale(1.0, 1.0, "N"), "units must be one of force (N, kN, mN"),
        (lambda: Scale(1.0, 1.0, "mm,N"), "units must be one of force"),
        (lambda: Scale(1.0, 1.0, None), "units must be one of force"),
        (lambda: dimensional(**GIVEN | {"size": 100}), "size must be a number > 0 with its unit"),
        (lambda: dimensional(**GIVEN | {"size": "0.5mm"}), "size must be 1 to 1e+06 times"),
        (lambda: dimensional(**GIVEN | {"nu": 0.6}), "nu must be a number in (-1, 0.5], got 0.6"),
        (
            lambda: der.Scene(der.circle(), rectangular_section(4), scale=3.0),
            "scale must be a der.Scale or None, got 3.0",
        ),
    ],
)
def test_bad_input_is_named(make, message):
    """A ValueError names the argument, what is allowed and the value."""
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make()
    assert str(error.value).startswith(message)
