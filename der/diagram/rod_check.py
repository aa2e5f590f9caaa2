"""A phase diagram's labels held against those of another solver, near its boundaries and away."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from der.diagram.cases import Row, row_by
from der.diagram.scan import Node, Scan, corners
from der.records.path import Path
from der.scene import Scene
from der.utils.checks import Array

Fold: TypeAlias = Callable[[Scene], Path]

AWAY = 0.02  # of the diagram's side: further than this from every boundary
# with half and a quarter of the edges, too, to extrapolate from
WANTED: dict[str, Any] = {"n_edges": 128, "error_bars": True, "save_at": ()}
WANTED |= {"self_crossings": False}


@dataclass(frozen=True)
class Compared:
    """One case by both solvers; `near`: beside a boundary, else further than AWAY from any."""

    bvp: Row
    rod: Row
    near: bool

    @property
    def agrees(self) -> bool:
        """Whether both are solved and have the same label."""
        return self.rod.ok and self.bvp.label == self.rod.label


def rod_check(scan: Scan, fold: Fold, sample: int) -> tuple[Compared, ...]:
    """Labels of a sample of a scan's cases by another solver.

    Parameters
    ----------
    scan : the diagram
    fold : the path of a scene, such as `der.fold`; a case for which it raises is a failed row
    sample : how many cases, half of them beside a boundary; the same at every call

    Returns
    -------
    tuple of Compared
        Fewer where there are not so many cases.
    """
    draw = random.Random(scan.family.name)
    beside = {node for cell in scan.mixed for node in corners(cell)}
    near = sorted(node for node in beside if scan.rows[node].ok)
    away = _away(scan)
    chosen = [(node, True) for node in draw.sample(near, min(sample // 2, len(near)))]
    chosen += [(node, False) for node in draw.sample(away, min(sample - len(chosen), len(away)))]
    return tuple(
        Compared(scan.rows[node], row_by(scan.rows[node].case, fold, **WANTED), near)
        for node, near in chosen
    )


def _away(scan: Scan) -> list[Node]:
    """Solved nodes that are far from the mixed cells."""
    nodes = sorted(node for node, row in scan.rows.items() if row.ok)
    if not scan.mixed:
        return nodes
    mixed = np.array([_place(scan, node) for node, _ in scan.mixed]) + 0.5 / scan.family.finest
    reach = AWAY + 0.5 / scan.family.finest
    return [n for n in nodes if np.abs(mixed - _place(scan, n)).max(axis=1).min() > reach]


def _place(scan: Scan, node: Node) -> Array:
    """Unit coordinates of a node; the second sheet continues the first beyond b = a."""
    sheet, place = node
    at = np.array(place) / scan.family.finest
    if sheet != scan.family.sheets[0]:
        at[0] = 2.0 - at[0]
    return at


def table(compared: tuple[Compared, ...]) -> str:
    """Agreement in a few lines of text, and every disagreement."""
    lines = []
    for near, words in ((True, "beside a boundary"), (False, f"over {AWAY:.0%} from any")):
        some = [pair for pair in compared if pair.near is near]
        agree = sum(pair.agrees for pair in some)
        lines.append(f"rod check, {words}: {agree} of {len(some)} labels agree")
    for pair in compared:
        if not pair.agrees:
            case = ", ".join(f"{k}={v}" for k, v in pair.bvp.case.to_json().items())
            where = "near" if pair.near else "away"
            lines.append(
                f"  {where}: {case}: {pair.bvp.label} | rod: {pair.rod.label} {_why(pair)}"
            )
    return "\n".join(lines)


def _why(pair: Compared) -> str:
    return f"({pair.rod.message})" if pair.rod.message else ""
