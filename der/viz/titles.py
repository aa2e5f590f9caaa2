"""The title of every picture: ring, section, mesh and further facts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from der.records.path import Mode, Path

BETWEEN = "   |   "  # the parts of a title
DEGREES = {"vertex_angle": "°"}
STAYS, OPENS = "stays folded when released", "opens when released"
SOLVERS = {"der": "rod", "bvp": "boundary-value problem"}


def title(record: Any, *more: str, mesh: bool = True) -> str:
    """Ring, section and mesh of a record, and more parts, in one line.

    Parameters
    ----------
    record : with `ring` and `numerics`, and `section` unless it varies.
    mesh : whether the mesh is named.
    """
    parts = [ring_text(record.ring), section_text(getattr(record, "section", {}))]
    if getattr(record, "scale", None) is not None:
        length, name = record.scale.unit("length")
        parts.append(f"a = {length:.6g} {name}")
    if mesh:
        parts.append(mesh_text(record.numerics))
    return BETWEEN.join(part for part in (*parts, *more) if part)


def ring_text(ring: Mapping[str, object]) -> str:
    """Shape of a ring and its parameters: "ellipse, b/a = 0.6, about y"."""
    parts = [str(ring["shape"])]
    parts += [
        f"{plain(name)} = {value:g}{DEGREES.get(name, '')}"
        for name, value in ring.items()
        if isinstance(value, float) and (name, value) != ("natural_curvature", 1.0)
    ]
    if ring.get("twist_axis") == "y":
        parts.append("about y")
    return ", ".join(parts)


def section_text(section: Mapping[str, object], *, nu: bool = True) -> str:
    """A section by h/t and Poisson's ratio, or else by its ratios of stiffness."""
    if not section:
        return ""
    if section.get("h_over_t") is None:
        return f"α = {section['alpha']:.4g}, β = {section['beta']:.4g}"
    ratio = f", ν = {section['nu']:g}" if nu and section.get("nu") is not None else ""
    return f"h/t = {section['h_over_t']:.6g}{ratio}"


def folded_text(mode: Mode) -> str:
    """What a folded ring needs to stay so: "stable at fixed M, opens when released"."""
    if mode.stable_free:
        return STAYS
    if not mode.stable or mode.stable_3d is False:
        return "unstable at fixed M"
    return f"stable at fixed M, {'released: unknown' if mode.stable_free is None else OPENS}"


def mesh_text(numerics: Mapping[str, object]) -> str:
    """The number of edges, and whether results are extrapolated from them."""
    edges = numerics.get("n_edges")
    if edges is None:
        return SOLVERS["bvp"]
    return f"extrapolated from {edges} edges" if numerics.get("error_bars") else f"{edges} edges"


def plain(name: str) -> str:
    """A parameter's name as text: "h/t", "natural curvature"."""
    return name.replace("_over_", "/").replace("_", " ")


def sure(value: float, error: float) -> str:
    """An extrapolated value with its error, both to the second digit of the error."""
    if not error > 0.0:
        return f"{value:.6g}"
    places = min(max(1 - math.floor(math.log10(error)), 0), 12)
    return f"{value:.{places}f} ± {error:.{places}f}"


def times_pi(angle: float) -> str:
    """An angle as a multiple of pi: "0", "0.211 π", "π"."""
    multiple = f"{angle / math.pi:.3g}"
    return {"0": "0", "1": "π"}.get(multiple, f"{multiple} π")


# --- Names of paths ----------------------------------------------------------------------------


def names(paths: Sequence[Path]) -> list[str]:
    """A short name for each path, which differs from the others' names.

    Each has ring and section. Where paths differ in Poisson's ratio, the solver or the control,
    these follow; other numerics follow until no two names are equal.
    """
    found = [f"{ring_text(path.ring)}, {section_text(path.section, nu=False)}" for path in paths]
    values = [{**path.section, **path.numerics, "solver": _solver(path, paths)} for path in paths]
    first = ["nu", "solver", "control"]
    others = sorted({name for one in values for name in one} - {*first, "version"})
    for name in [*first, *others]:
        if name in first or len(set(found)) < len(found):
            found = _told(found, name, [one.get(name) for one in values])
    if len(set(found)) < len(found):
        found = [f"{name} ({k})" for k, name in enumerate(found, 1)]
    return found


def _solver(path: Path, paths: Sequence[Path]) -> str:
    """The solver of a path; where all paths are of rods, its method."""
    method = path.numerics.get("solver")
    if method is not None and all(one.solver == "der" for one in paths):
        return f"{SOLVERS['der']} by {method}"
    return SOLVERS[path.solver]


def _told(found: Sequence[str], name: str, values: Sequence[Any]) -> list[str]:
    """Names followed by a parameter, where paths differ in it."""
    if all(value == values[0] for value in values):
        return list(found)
    return [
        f"{one}, {_parameter(name, value)}" if isinstance(value, str | int | float) else one
        for one, value in zip(found, values, strict=True)
    ]


def _parameter(name: str, value: str | float) -> str:
    if name == "solver":
        return str(value)
    if isinstance(value, bool):
        return plain(name) if value else f"no {plain(name)}"
    return f"{plain(name)} {value:.4g}" if isinstance(value, float) else f"{plain(name)} {value}"
