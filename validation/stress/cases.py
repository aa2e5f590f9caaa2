"""Scenes that are meant to break the solvers: drawn at random, corners first, from a seed.

A case is plain JSON: one that failed can be kept, sent and run again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import der
from der.geometry.shapes import ring_from_json, triangle_in_degrees
from der.scene import MEASURES
from der.utils.checks import Array

Parameters = dict[str, Any]
Draw = Callable[[np.random.Generator, int], Parameters]

BIRTH_OF_FOLDS = 1.839582  # h/t of the circle, nu = 0.3, at which its two folds are born


@dataclass(frozen=True)
class Case:
    """One thing to try.

    Parameters
    ----------
    kind : one of `KINDS`.
    parameters : everything that is needed to repeat it, in JSON's types.
    """

    kind: str
    parameters: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """The entries of its JSON object."""
        return {"kind": self.kind, "parameters": dict(self.parameters)}


def case_from_json(entries: object) -> Case:
    """The case that `Case.to_json` wrote.

    Raises
    ------
    ValueError
        If it is no such object.
    """
    if not isinstance(entries, Mapping) or not {"kind", "parameters"} <= set(entries):
        raise ValueError(f"case must be an object with kind and parameters, got {entries!r}")
    kind, parameters = entries["kind"], entries["parameters"]
    if kind not in KINDS or not isinstance(parameters, Mapping):
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}")
    return Case(kind, parameters)


def cases(count: int, seed: int, *, most_edges: int = 2048) -> Iterator[Case]:
    """Cases at random, every kind among the first `len(KINDS)` of them.

    Parameters
    ----------
    most_edges : of the full ring; large ones are rare.
    """
    random = np.random.default_rng(seed)
    names, weights = list(KINDS), np.array([weight for weight, _ in KINDS.values()], dtype=float)
    for k in range(count):
        name = names[k] if k < len(names) else str(random.choice(names, p=weights / weights.sum()))
        yield Case(name, KINDS[name][1](random, most_edges))


# --- From parameters to the statement --------------------------------------------------------


def scene_of(parameters: Mapping[str, Any], **more: Any) -> der.Scene:
    """The scene of a case, with further entries."""
    wants = dict(parameters["wants"]) | more
    return der.Scene(ring_of(parameters["ring"]), section_of(parameters), **wants)


def section_of(parameters: Mapping[str, Any]) -> der.Section:
    """The section of a case."""
    if "alpha" in parameters:
        return der.section(parameters["alpha"], parameters["beta"])
    return der.rectangular_section(parameters["h_over_t"], parameters["nu"])


def ring_of(entries: Mapping[str, Any]) -> der.Ring:
    """The ring of a case: as in a record, or through noisy points along one of these."""
    if "points" not in entries:
        return ring_from_json(entries)
    return der.profile(points=noisy_points(ring_of(entries["of"]), **entries["points"]))


def noisy_points(ring: der.Ring, count: int, noise: float, seed: int, *, symmetric: bool) -> Array:
    """Points (n, 2) along a ring, each moved at random, by ``noise`` at one standard deviation.

    Parameters
    ----------
    symmetric : whether the noise keeps the ring's mirror symmetry about the twisting axis.
    """
    random = np.random.default_rng(seed)
    points = ring.position(np.linspace(0.0, ring.length, count, endpoint=False))[:, 1:]
    moved = noise * random.standard_normal(points.shape)
    if symmetric:
        mirrored = np.roll(moved[::-1], 1, axis=0) * [-1.0, 1.0]
        moved = 0.5 * (moved + mirrored)
    moved[0, 0] = 0.0
    return points + moved


# --- What is drawn ---------------------------------------------------------------------------


def _log(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


def _section(random: np.random.Generator) -> Parameters:
    """h/t and nu over the range of the solvers, with its ends and the critical values."""
    critical = [0.05, 1.0, 1.5075766, 1.6, BIRTH_OF_FOLDS, 3.469928, 4.0, 100.0]
    drawn = [_log(random, 0.05, 100.0), _log(random, 0.5, 6.0), random.choice(critical)]
    h_over_t = float(random.choice(drawn, p=[0.4, 0.4, 0.2]))
    nu = float(random.choice([0.0, 0.3, 0.5, random.uniform(0.0, 0.5)]))
    return {"h_over_t": h_over_t, "nu": nu}


def _ring(random: np.random.Generator, *, shapes: tuple[str, ...] = ()) -> Parameters:
    """A ring of any shape, down to fillets of 0.005 a and slender ones."""
    shape = str(random.choice(shapes or ("circle", "ellipse", "rectangle", "triangle")))
    axis = str(random.choice(["x", "y"]))
    if shape == "circle":
        return der.circle().to_json()
    if shape == "ellipse":
        return der.ellipse(float(random.choice([random.uniform(0.1, 1.0), 1.0])), axis).to_json()
    if shape == "rectangle":
        b = float(random.choice([_log(random, 0.05, 1.0), 1.0]))
        r = float(random.choice([0.005, b, _log(random, 0.005, b)]))
        return der.rectangle(b, r, axis).to_json()
    apex = float(random.choice([60.0, 90.0, random.uniform(10.0, 160.0)]))
    inscribed = 0.5 * math.tan(math.pi / 4 - math.radians(apex) / 4)
    r = float(random.choice([0.005, inscribed, _log(random, 0.005, inscribed)]))
    return triangle_in_degrees(apex, r).to_json()


def _edges(random: np.random.Generator, most: int) -> int:
    """Edges: divisible by 16, so that every sector has them; mostly few, sometimes many."""
    if random.random() < 0.1:
        return 8
    largest = math.log2(min(most, 2048) if random.random() < 0.06 else min(most, 256))
    return 16 * max(1, round(2.0 ** random.uniform(4.0, largest) / 16))


def _wants(random: np.random.Generator, ring: Parameters, most: int) -> Parameters:
    """The entries of a scene that can be chosen freely, without its control."""
    no_quarter = ring["shape"] in ("triangle", "profile")
    sectors = ["auto", "auto", "half", "full"] + ([] if no_quarter else ["quarter"])
    return {
        "n_edges": _edges(random, most),
        "sector": str(random.choice(sectors)),
        "curvature": str(random.choice([*MEASURES, MEASURES[0]])),
        "stretch": str(random.choice(["inextensible", "inextensible", "finite"])),
        "a_over_t": float(random.choice([200.0, _log(random, 10.0, 1e5)])),
        "tolerance": float(random.choice([1e-10, 10.0 ** random.uniform(-16.0, -4.0)])),
        "stability": bool(random.random() < 0.8),
    }


def _path(random: np.random.Generator, most: int) -> Parameters:
    ring = _ring(random)
    wants = _wants(random, ring, most)
    if random.random() < 0.2:
        wants["gamma_max"] = _log(random, 1e-3, math.pi)
    if random.random() < 0.2:
        last = wants.get("gamma_max", math.pi)
        wants["save_at"] = sorted(random.uniform(0.0, last, 7).tolist())
    return {"ring": ring, **_section(random), "wants": wants}


def _paths(most_here: int, **wants: Any) -> Draw:
    """Paths on few edges, with entries of the scene that are always the same."""

    def draw(random: np.random.Generator, most: int) -> Parameters:
        found = _path(random, min(most, most_here))
        return found | {"wants": found["wants"] | wants}

    return draw


def _beyond(random: np.random.Generator, most: int) -> Parameters:
    """Several turns of the grips, or until folded."""
    found = _path(random, min(most, 64))
    found["wants"].pop("save_at", None)
    found["wants"]["gamma_max"] = _log(random, math.pi, 10.0 * math.pi)
    if random.random() < 0.3:
        found["wants"] |= {"until": "folded", "gamma_max": math.pi}
    return found


def _close_folds(random: np.random.Generator, most: int) -> Parameters:
    """The circle near the section where its two folds are born, as close together as possible."""
    n_edges = int(random.choice([32, 64, 128]))
    away = float(random.choice([-1.0, 1.0])) * 10.0 ** random.uniform(-9.0, -1.5)
    wants = {"n_edges": min(n_edges, most), "sector": str(random.choice(["auto", "full"]))}
    # on N edges they are born elsewhere, by about 5.5/N^2 of h/t
    h_over_t = BIRTH_OF_FOLDS + float(random.choice([0.0, random.uniform(-1.0, 1.0) * 1e-2])) + away
    return {"ring": der.circle().to_json(), "h_over_t": h_over_t, "nu": 0.3, "wants": wants}


def _natural_curvature(random: np.random.Generator, most: int) -> Parameters:
    found = _path(random, min(most, 128))
    natural = float(random.choice([-2.0, -1.0, 0.0, 3.0, 4.0, random.uniform(-2.0, 4.0)]))
    found["ring"] = der.circle(natural).to_json()
    return found


def _error_bars(random: np.random.Generator, most: int) -> Parameters:
    found = _path(random, min(most, 256))
    found["wants"] |= {
        "error_bars": True,
        "n_edges": max(32, found["wants"]["n_edges"] // 16 * 16),
        "tolerance": 1e-10,
    }
    return found


def _angle(random: np.random.Generator, most: int) -> Parameters:
    """The grips turned up to as much as 10 pi and back."""
    found = _path(random, min(most, 64))
    found["wants"] |= {"control": "angle", "unload": bool(random.random() < 0.8)}
    if random.random() < 0.3:
        found["wants"].pop("save_at", None)
        found["wants"]["gamma_max"] = _log(random, math.pi, 10.0 * math.pi)
    return found


def _moment(random: np.random.Generator, most: int) -> Parameters:
    found = _path(random, min(most, 64))
    found["wants"] |= {"control": "moment", "unload": bool(random.random() < 0.5)}
    return found


def _bvp(random: np.random.Generator, most: int) -> Parameters:
    found = _path(random, most)
    wants = {
        name: found["wants"][name] for name in ("gamma_max", "save_at") if name in found["wants"]
    }
    if random.random() < 0.15:
        turns = 1.2 if most < 256 else 4.0  # far beyond pi a path can take its 2000 steps
        wants = {"gamma_max": float(random.uniform(math.pi, turns * math.pi))}
    if random.random() < 0.1:
        wants = {"until": "folded"}
    bvp = {"tolerance": float(random.choice([1e-8, 10.0 ** random.uniform(-11.0, -3.0)]))}
    return found | {"wants": wants, "bvp": bvp}


def _compare(random: np.random.Generator, most: int) -> Parameters:
    """Rings that both solvers resolve well: the rod's error bars must hold the other's values."""
    shape = str(random.choice(["circle", "ellipse", "rectangle"]))
    axis = str(random.choice(["x", "y"]))
    ring = der.circle()
    if shape == "ellipse":
        ring = der.ellipse(float(random.uniform(0.5, 1.0)), axis)
    elif shape == "rectangle":
        b = float(random.uniform(0.3, 1.0))
        ring = der.rectangle(b, float(random.uniform(0.2 * b, b)), axis)
    return {
        "ring": ring.to_json(),
        "h_over_t": _log(random, 1.0, 10.0),
        "nu": float(random.uniform(0.0, 0.5)),
        "wants": {"n_edges": int(random.choice([64, 128])), "error_bars": True},
    }


def _steps(random: np.random.Generator, most: int) -> Parameters:
    """The same path in other steps."""
    found = _paths(64, tolerance=1e-11, sector="auto")(random, most)
    longest = float(random.choice([0.05, 0.2, 1.0]))
    return found | {"steps": {"first": _log(random, 1e-4, 0.5), "longest": longest}}


def _threads(random: np.random.Generator, most: int) -> Parameters:
    return {"rings": [_path(random, min(most, 64)) for _ in range(4)]}


def _points(random: np.random.Generator, most: int) -> Parameters:
    """Profiles through inaccurate points."""
    found = _path(random, min(most, 128))
    of = _ring(random, shapes=("circle", "ellipse", "rectangle"))
    points = {
        "count": int(random.integers(4, 200)),
        "noise": float(random.choice([0.0, _log(random, 1e-9, 1e-1)])),
        "seed": int(random.integers(2**31)),
        "symmetric": bool(random.random() < 0.7),
    }
    found["wants"]["sector"] = str(random.choice(["auto", "half", "full"]))
    return found | {"ring": {"of": of, "points": points}}


def _extreme(random: np.random.Generator, most: int) -> Parameters:
    """One number at a time that is extreme, but allowed."""
    wants: Parameters = {"n_edges": int(random.choice([8, 16, 32]))}
    found: Parameters = {
        "ring": der.circle().to_json(),
        "h_over_t": _log(random, 0.5, 6.0),
        "nu": 0.3,
    }
    which = str(random.choice(["gamma_max", "save_at", "section", "a_over_t", "ring", "natural"]))
    if which == "gamma_max":
        wants["gamma_max"] = 10.0 ** random.uniform(-323.0, 6.0)
    elif which == "save_at":
        first = 10.0 ** random.uniform(-323.0, 0.0)
        wants["save_at"] = [first, first + 10.0 ** random.uniform(-17.0, 0.0)]
    elif which == "section":
        found |= {name: 10.0 ** random.uniform(-6.0, 8.0) for name in ("alpha", "beta")}
    elif which == "a_over_t":
        wants |= {"stretch": "finite", "a_over_t": 10.0 ** random.uniform(-3.0, 6.0)}
    elif which == "ring":
        b = _log(random, 1e-3, 0.1)
        axis = str(random.choice(["x", "y"]))
        thin = (der.ellipse(b, axis), der.rectangle(b, _log(random, 1e-4, b), axis))
        apex = float(random.choice([0.1, 1.0, 170.0]))
        rings = (*thin, triangle_in_degrees(apex, 1e-4))
        found["ring"] = rings[int(random.integers(3))].to_json()
    else:
        found["ring"] = der.circle(
            float(random.choice([-1.0, 1.0])) * _log(random, 4.0, 1e4)
        ).to_json()
    if which != "gamma_max" and random.random() < 0.3:
        wants |= {"control": "angle", "unload": True}
    return found | {"wants": wants}


def _scale(random: np.random.Generator, most: int) -> Parameters:
    """Rings from nanometres to kilometres, of jelly and of diamond."""
    a = 10.0 ** random.uniform(-9.0, 3.0)
    t = a * 10.0 ** random.uniform(-5.0, -1.0)
    return {
        "young_modulus": 10.0 ** random.uniform(2.0, 12.5),
        "nu": float(random.uniform(-0.9, 0.5)),
        "h": t * _log(random, 0.05, 100.0),
        "t": t,
        "a": a,
        "times": 10.0 ** random.uniform(-6.0, 6.0),
    }


def _input(random: np.random.Generator, most: int) -> Parameters:
    """Positions of an argument and of a value in the lists of `inputs`."""
    return {"argument": int(random.integers(2**16)), "value": int(random.integers(2**16))}


# How often a kind is drawn, and by which function; all but "input" and "scale" follow a path.
KINDS: dict[str, tuple[int, Draw]] = {
    "path": (30, _path),
    "beyond": (6, _beyond),
    "close folds": (5, _close_folds),
    "natural curvature": (5, _natural_curvature),
    "error bars": (6, _error_bars),
    "angle": (8, _angle),
    "moment": (6, _moment),
    "relaxation": (3, _paths(32, control="angle", solver="relaxation", stretch="inextensible")),
    "bvp": (10, _bvp),
    "compare": (4, _compare),
    "symmetry": (5, _paths(64, sector="auto", tolerance=1e-12, stretch="inextensible")),
    "steps": (4, _steps),
    "again": (4, _paths(128)),
    "threads": (2, _threads),
    "points": (6, _points),
    "extreme": (6, _extreme),
    "scale": (4, _scale),
    "input": (12, _input),
}
