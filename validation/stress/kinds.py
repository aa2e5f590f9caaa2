"""What is done with each kind of case of a stress run, and what must hold for the result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import der
from der.analysis import fold as folding
from der.analysis.request import Request, ring_of
from der.bvp.solve import solve_bvp
from der.errors import NotConverged
from der.geometry.scale import Scale
from der.kernels.assembly import derivatives
from der.kernels.linking import link
from der.records.configurations import Shapes
from der.records.path import NUMBERS, Path
from der.rod.free_ring import balance
from der.rod.gripped_ring import GrippedRing
from der.scene import CROSSINGS_UP_TO, Scene
from der.utils.checks import Array
from validation.stress import checks
from validation.stress.cases import KINDS, scene_of
from validation.stress.checks import Fault
from validation.stress.inputs import PERHAPS, arguments, refusal
from validation.stress.random_rings import LOOSE

SYMMETRIC = 1e-6  # a: a path that was followed on the full ring without leaving the symmetric one
RETURNED = 1e-6  # a: a ring that has come back
TIMES = 10.0  # an extrapolated value may be off by so many times its estimated error
LOOSEST = 1e-9  # tolerance beyond which states of two solves are not compared


class Refused(ValueError):
    """The scene is refused, in a sentence."""


# --- One path and all that must hold of it ---------------------------------------------------


def _scene(parameters: Mapping[str, Any], **more: Any) -> Scene:
    """The scene of a case; `Refused` where its values are not allowed."""
    try:
        return scene_of(parameters, **more)
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


def _folded(scene: Scene) -> Path:
    """The path, finished or not."""
    return _finished_or_not(der.fold, scene)


def _finished_or_not(solver: Callable[[Scene], Path], scene: Scene) -> Path:
    try:
        return solver(scene)
    except NotConverged as failure:
        path = failure.path
        if path.status != "not converged" or path.message != str(failure):
            raise AssertionError("the path that is left does not say why it is") from None
        return path


def unfinished(path: Path) -> Iterator[Fault]:
    """Why a path is not finished."""
    if path.status != "done":
        yield checks.not_converged(path.reason), path.message


def _path(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path, and every check of a single path."""
    scene = _scene(parameters, shapes=True)
    path = _folded(scene)
    yield from unfinished(path)
    yield from _judged(scene, path)
    if scene.unload and path.status == "done" and not any(p.kind == "snap" for p in path.points):
        yield from _returned(scene, path)


def _judged(scene: Scene, path: Path) -> Iterator[Fault]:
    if not len(path):
        return
    yield from checks.faults(scene, path)
    if path.shapes is not None:
        yield from balanced(scene, path, path.shapes)
        symmetric = scene.control == "arclength" or scene.sector == "auto"
        if symmetric and scene.tolerance <= LOOSEST and scene.ring.shape != "profile":
            off = checks.asymmetry(scene, path.shapes)
            # at a branch point the ring can move along the other path at no cost
            off[[point.position for point in path.branches]] = 0.0
            if (worst := float(off.max(initial=0.0))) > SYMMETRIC:
                yield "asymmetric", f"a state is {worst:.2g} a off its ring's symmetry"
    if scene.tolerance <= 1e-7:
        yield from _work(scene, path, der.fold)


def _work(scene: Scene, path: Path, solver: Callable[[Scene], Path]) -> Iterator[Fault]:
    """Energy is work; where the states are too few to tell, the path is solved with more."""
    if path.status != "done" or checks.work_lost(path) <= LOOSE:
        return
    gammas = checks.denser(path, scene.gamma_max)
    lost = checks.work_lost(
        solver(replace(scene, save_at=gammas, shapes=False, error_bars=False)), asked=True
    )
    if lost > LOOSE:
        yield "energy is not work", f"U and the integral of 4 M dgamma differ by {lost:.2g} of U"


def _returned(scene: Scene, path: Path) -> Iterator[Fault]:
    """After a loop without a snap the ring is back in its first state."""
    if path.shapes is None or scene.tolerance > LOOSEST or path.gamma[-1] != path.gamma[0]:
        return
    off = float(np.abs(path.shapes.x[-1] - path.shapes.x[0]).max())
    if off > (1e-3 if scene.solver == "relaxation" else RETURNED):
        yield "no return", f"the ring comes back {off:.2g} a away from where it was"


def balanced(scene: Scene, path: Path, shapes: Shapes) -> Iterator[Fault]:
    """Every state, whatever sector it was found on, is an equilibrium of the full ring.

    Its frames are taken from the record; the internal forces, which are not in it, are fitted. So
    residual, energy and moment are computed anew, and Tw + Wr.
    """
    ring = ring_of(scene, "full")
    raw = path.raw or {}
    rod = ring.rod
    # arc lengths are rounded, and so are cells, which are their differences
    rounding = 1e-15 * scene.ring.length * float(rod.stiffness.max() / rod.cell.min() ** 2)
    columns = [np.asarray(raw.get(name, getattr(path, name))) for name in NUMBERS]
    scales = [max(float(np.abs(column).max(initial=0.0)), 1e-3) for column in columns]
    tolerance = max(scene.tolerance, 1e-8 if scene.solver == "relaxation" else 0.0)
    if scene.stretching and tolerance > LOOSEST:  # a gap, all in one edge, would be stretch
        return
    links = scene.n_edges <= min(256, CROSSINGS_UP_TO)
    worst = np.zeros(len(_BALANCED))
    for k, (gamma, moment, energy) in enumerate(zip(*columns, strict=True)):
        quat = _quaternions(shapes.frames[k])
        edge = shapes.x[k] - np.roll(shapes.x[k], 1, axis=0)
        length = np.sum(edge * shapes.frames[k, :, 2], axis=1)
        stretch = length / rod.length - 1.0 if scene.stretching else np.zeros(len(quat))
        residual, noise, found_energy, found_moment = _residual(ring, quat, stretch, float(gamma))
        allowed = 20.0 * max(tolerance, 10.0 * noise) + 1e-14 * scene.stretching + rounding
        flat = gamma != 0.0 and float(np.ptp(shapes.x[k, :, 0])) < 1e-3
        linked = link(quat, length)[1] if links and not flat and k % 4 == 0 else 0.0
        off = (
            residual / allowed,
            abs(found_energy - energy) / (1e-8 * scales[2] + allowed),
            abs(found_moment - moment) / (1e-7 * scales[1] + scene.n_edges * allowed),
            linked / (1e-8 + 100.0 * tolerance),
        )
        worst = np.maximum(worst, off)
    for name, size in zip(_BALANCED, worst, strict=True):
        if not size <= 1.0:
            yield f"{name} of the full ring", f"{size:.3g} times what rounding allows"


_BALANCED = ("residual", "energy", "moment", "link")


def _quaternions(frames: Array) -> Array:
    """Quaternions (N, 4), scalar first, of frames (N, 3, 3) whose rows are d1, d2, d3."""
    found = Rotation.from_matrix(frames.swapaxes(1, 2)).as_quat()
    return np.ascontiguousarray(np.roll(found, 1, axis=1))


def _residual(
    ring: GrippedRing, quat: Array, stretch: Array, gamma: float
) -> tuple[float, float, float, float]:
    """Residual, its rounding error, energy and M of a state of the full ring."""
    found = balance(ring.rod, quat, stretch, ring.supports, gamma)
    _, (energy, conjugate, _, noise, _) = derivatives(ring.rod, ring.supports, *found.state)
    return found.residual, noise, energy, ring.arm_moment(conjugate)


# --- The other kinds -------------------------------------------------------------------------


def _bvp(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path of the boundary-value problem."""
    scene = _scene(parameters, shapes=True)
    tolerance = parameters["bvp"]["tolerance"]

    def solver(scene: Scene) -> Path:
        return solve_bvp(scene, tolerance=tolerance)

    path = _finished_or_not(solver, scene)
    yield from unfinished(path)
    yield from (
        fault for fault in checks.faults(scene, path) if tolerance < 1e-5 or fault[0] != "start"
    )
    yield from checks.too_uncertain(path, tolerance)
    if tolerance <= 1e-5 and len(path):
        yield from _work(scene, path, solver)


def _compare(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """The rod's error bars hold the values of the boundary-value problem.

    Near a boundary between folding modes a coarse mesh may be on the other side, with another path:
    finer meshes are tried before the two are said to differ.
    """
    scene = _scene(parameters)
    reference = solve_bvp(scene, tolerance=1e-9)
    found: list[Fault] = []
    for finer in (1, 2, 4):
        path = der.fold(replace(scene, n_edges=finer * scene.n_edges))
        found = list(checks.outside_error_bars(path, reference, TIMES))
        if len(path.folds) == len(reference.folds):
            break
    yield from found


def _symmetry(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path on the sector is that on the full ring."""
    found = [_folded(_scene(parameters, sector=name)) for name in ("auto", "full")]
    for path in found:
        yield from unfinished(path)
    if all(path.status == "done" for path in found):
        yield from checks.unlike(found[0], found[1], 1e-7)


def _steps(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path does not depend on the steps in which it is followed."""
    scene = _scene(parameters)
    usual = _folded(scene)
    with _stepping(**parameters["steps"]):
        other = _folded(scene)
    yield from unfinished(other)
    if usual.status == other.status == "done":
        yield from checks.unlike(usual, other, 1e-7)


@contextmanager
def _stepping(first: float, longest: float) -> Iterator[None]:
    """Follow paths in steps of other lengths."""
    usual = folding._request

    def request(scene: Scene) -> Request:
        asked = usual(scene)
        options = replace(asked.options, first_step=first, largest_step=longest)
        return replace(asked, options=options)

    folding._request = request
    try:
        yield
    finally:
        folding._request = usual


def _again(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """The same scene gives the same record to the last bit."""
    first, second = (_without_time(_folded(_scene(parameters))) for _ in range(2))
    if first != second:
        yield "not repeatable", "two runs of one scene differ"


def _threads(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """Rings folded at once in threads come out as they do one after the other."""
    scenes = [_scene(one) for one in parameters["rings"]]
    alone = [_without_time(_folded(scene)) for scene in scenes]
    with ThreadPoolExecutor(len(scenes)) as pool:
        together = [_without_time(path) for path in pool.map(_folded, scenes)]
    if alone != together:
        yield "threads", "a ring folded beside others differs from the same folded alone"


def _without_time(path: Path) -> str:
    return replace(path, timing=replace(path.timing, solve_s=0.0)).to_json()


def _scale(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """Units grow with the size as GJ/a, of a^3, and with E; h and t may be exchanged."""
    given = dict(parameters)
    times = given.pop("times")
    one = Scale.of(**given)
    larger = Scale.of(**given | {name: times * given[name] for name in ("h", "t", "a")})
    stiffer = Scale.of(**given | {"young_modulus": times * given["young_modulus"]})
    turned = Scale.of(**given | {"h": given["t"], "t": given["h"]})
    powers = {"moment": 3, "energy": 3, "length": 1, "force": 2}
    for name, power in powers.items():
        unit = getattr(one, name)
        for what, other, factor in (
            ("size", larger, times**power),
            ("E", stiffer, 1.0 if name == "length" else times),
            ("turning h and t", turned, 1.0),
        ):
            ratio = getattr(other, name) / unit / factor
            if not abs(ratio - 1.0) < 1e-12:
                yield "units", f"the unit of {name} changes with {what} by {ratio} of what it must"


def _input(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A value that an argument must not take is refused in a sentence that names the argument."""
    known = arguments()
    argument = known[parameters["argument"] % len(known)]
    names = list(argument.refused if len(argument.refused) < 9 else {**argument.refused, **PERHAPS})
    if argument.where not in _TAKES_NUMBERS:
        names = list(argument.refused)
    if not names:
        return
    wrong = refusal(argument, names[parameters["value"] % len(names)])
    if wrong is not None:
        yield "input", wrong


_TAKES_NUMBERS = ("circle", "section", "rectangular_section", "Scale", "Scale.of", "Section")

Run = Callable[[Mapping[str, Any]], Iterator[Fault]]
RUN: dict[str, Run] = dict.fromkeys(KINDS, _path) | {
    "bvp": _bvp,
    "compare": _compare,
    "symmetry": _symmetry,
    "steps": _steps,
    "again": _again,
    "threads": _threads,
    "scale": _scale,
    "input": _input,
}
