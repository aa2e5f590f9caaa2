"""Open rods under dead loads, followed with events by the public API alone."""

import numpy as np
import pytest

import der


def cantilever(pull, stiffness=(1.0, 1.0, 1.0), n=128):
    """A straight rod of length 1, clamped along E3, with a dead force at its tip as the load."""
    rod = der.discrete_rod(np.full(n, 1.0 / n), np.zeros(n), stiffness)
    supports = der.supported(rod, clamped=(0,), pull=np.array(pull))
    return der.RodSystem(rod, supports, parameter_name="force"), der.straight(rod)


def test_a_cantilever_under_a_dead_tip_force_is_the_elastica():
    """Tip positions (z, y) of Bisshopp and Drucker (1945), to the second order of 128 edges."""
    system, start = cantilever([0.0, 1.0, 0.0])
    events = der.Events(targets=(1.0, 10.0), stop=lambda at: at.parameter == 10.0, stability=True)
    points = list(der.follow(system, start, events))
    exact = {1.0: (0.9435668, 0.3017208), 10.0: (0.4450044, 0.8106090)}
    for force, place in exact.items():
        (one,) = (one for one in points if one.solution.parameter == force)
        tip = system.positions(one.solution.state)[-1]
        np.testing.assert_allclose(tip[[2, 1]], place, atol=1e-4)
    assert {one.index for one in points} == {(0,)}


def test_a_compressed_cantilever_buckles_at_euler_s_load():
    """A branch point at P = pi^2 EI/4 (Euler), EI the smaller stiffness, to the order h^2."""
    system, start = cantilever([0.0, 0.0, -1.0], (1.0, 3.0, 1.0))
    events = der.Events(targets=(4.0,), stop=lambda at: at.parameter == 4.0, stability=True)
    (branch,) = (one for one in der.follow(system, start, events) if one.kind)
    assert branch.kind == "branch"
    assert branch.sides == ((0,), (1,))
    np.testing.assert_allclose(branch.solution.parameter, np.pi**2 / 4.0, rtol=1e-4)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            lambda rod: der.supported(rod, clamped=(9,)),
            "clamped must name edges from 0 to 4, got 9",
        ),
        (lambda rod: der.supported(rod, pull=np.ones(2)), r"pull must have the shape \(3,\) or"),
        (lambda rod: of(rod).correct(der.straight(rod), hold="torque"), "hold must be one of"),
        (lambda rod: of(rod).correct(der.straight(rod, 3)), "guess must have 5 edges and 0 mult"),
        (lambda rod: follow(rod, limits=("work",)), "limits must be observables .*, got 'work'"),
    ],
)
def test_wrong_arguments_are_named(wrong, message):
    """The argument, the value and what is allowed; nothing reaches a kernel."""
    with pytest.raises(ValueError, match=message):
        wrong(der.discrete_rod(np.full(4, 0.25), np.zeros(4), (1.0, 1.0, 1.0)))


def of(rod):
    """A clamped rod."""
    return der.RodSystem(rod, der.supported(rod, clamped=(0,)))


def follow(rod, **wants):
    """Its path, however short."""
    return list(der.follow(of(rod), der.straight(rod), der.Events(**wants)))
