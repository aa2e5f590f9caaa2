"""Whether sectors, meshes and lengths of steps agree on the index: `python -m validation sectors`.

Circles of alpha = beta in [1, 2] and natural curvature in [-3, 3] have many branch points, some of
them close together. Each is followed to pi on the quarter, the half and the full ring, and on the
quarter once more in steps a sixth as long, on 64 and on 128 edges. Compared are the index of the
flat ring and its changes along the path, all counted on the full ring:

    search    on one mesh, a sector has other changes than the short steps, or elsewhere (1e-6 rad)
    mesh      short steps find other changes on 64 edges than on 128
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

import der
from der.analysis.request import Request
from der.errors import ContinuationFailed
from der.problem import Options, total_index
from der.rod.gripped_ring import gripped_ring

SECTORS = ("quarter", "half", "full")
SHORT = Options(largest_step=0.1)
SAME = 1e-6  # rad: changes on two sectors, and modes that cross zero together

Changes = list[tuple[float, int]]  # gamma [rad], and by how much the index changes; first the index


def rings(count: int, seed: int) -> Iterator[tuple[float, float]]:
    """Alpha = beta and natural curvature of random circles."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield float(random.uniform(1.0, 2.0)), float(random.uniform(-3.0, 3.0))


def changes(
    alpha: float, natural_curvature: float, sector: str, n_edges: int, options: Options
) -> Changes | str:
    """Index of the flat ring and its changes along the path, or why they are not known."""
    circle = der.circle(natural_curvature=natural_curvature)
    ring = gripped_ring(circle, der.section(alpha, alpha), n_edges, name=sector)
    found: Changes = []
    try:
        for one in Request(self_crossings=False, limits=False, options=options).follow(ring):
            counts = [total_index(ring, side) for side in one.sides or ()] or [
                total_index(ring, one.index)
            ]
            if None in counts:
                return "index unknown"
            if one.sides is not None or not found:
                first, last = (0, *counts)[-2:]
                found.append((one.solution.parameter, (last or 0) - (first or 0)))
    except ContinuationFailed as failure:
        return failure.reason.word
    return _together(found)


def _together(found: Changes) -> Changes:
    """Changes in one place as one."""
    one = found[:1]
    for (before, _), (gamma, jump) in pairwise(found):
        if abs(gamma - before) < SAME:
            one[-1] = (gamma, one[-1][1] + jump)
        else:
            one.append((gamma, jump))
    return one


def _agree(a: Changes | str, b: Changes | str) -> bool:
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return _jumps(a) == _jumps(b) and bool(
        np.allclose([g for g, _ in a], [g for g, _ in b], rtol=0.0, atol=SAME)
    )


def _jumps(found: Changes | str) -> str | list[int]:
    return found if isinstance(found, str) else [jump for _, jump in found]


@dataclass
class Survey:
    """What has been compared."""

    rows: list[dict[str, Any]] = field(default_factory=list)  # one a ring
    interrupted: bool = False

    def add(self, alpha: float, natural_curvature: float, edges: Sequence[int]) -> None:
        """Compare one ring."""
        ring = (alpha, natural_curvature)
        ways = [(sector, Options()) for sector in SECTORS] + [("quarter", SHORT)]
        found = {n: [changes(*ring, sector, n, how) for sector, how in ways] for n in edges}
        search = [
            f"{sector} {n}"
            for n, (*sectors, short) in found.items()
            for sector, one in zip(SECTORS, sectors, strict=True)
            if not _agree(one, short)
        ]
        mesh = any(_jumps(a[-1]) != _jumps(b[-1]) for a, b in pairwise(found.values()))
        row = {"alpha": alpha, "natural_curvature": natural_curvature}
        self.rows.append(row | {"search": search, "mesh": mesh, "found": found})

    def __str__(self) -> str:
        """Counts, and the rings that differ."""
        differ = [row for row in self.rows if row["search"] or row["mesh"]]
        lines = [f"{len(self.rows) - len(differ)} of {len(self.rows)} rings agree"]
        for row in differ:
            where = [*row["search"], *(["mesh"] if row["mesh"] else [])]
            lines.append(
                f"alpha = beta = {row['alpha']!r}, kappa0 = {row['natural_curvature']!r}: "
                + ", ".join(where)
            )
        return "\n".join(lines)


def survey(count: int, seed: int, edges: Sequence[int] = (64, 128)) -> Survey:
    """Compare random rings, until Ctrl-C."""
    done = Survey()
    try:
        for k, ring in enumerate(rings(count, seed)):
            done.add(*ring, edges)
            if sys.stderr.isatty():
                print(f"\r{k + 1} of {count} rings", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        done.interrupted = True
    return done


def saved(done: Survey) -> str:
    """Every change found as JSON."""
    return json.dumps({"rings": done.rows}, allow_nan=False) + "\n"
