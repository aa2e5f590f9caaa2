"""Records of many rings by the code of one checkout, compared with those by another.

    python -m validation.regression dump old --tree ../old    # before a change, by its own code
    python -m validation.regression dump new                  # after it, by this checkout
    python -m validation.regression compare old new           # 0: they agree; 3: they do not

`dump` writes a JSON record for each case, GROUP/CASE.json, in a Python process that imports the
other checkout, and resumes where it was stopped. It uses public names only, which old commits have.
`compare` checks the states at gammas that were asked for, special points, the state at pi, errors,
indices, modes and statuses; of diagrams the labels, boundaries as curves, and corners. It does not
check states at the ends of steps, times, sentences, and entries that only new records have.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path as File
from typing import Any, NamedTuple

import numpy as np

Cases = Iterator[tuple[str, Callable[[], Any]]]  # names, and what returns the record
Maker = tuple[Any, ...]  # name of what makes the ring, and its arguments

# --- Cases -----------------------------------------------------------------------------------

CIRCLE: Maker = ("circle",)
NARROW: Maker = ("ellipse", 0.6, "x")
SHARP: Maker = ("triangle", math.radians(90), 1 / 30)
PLAIN: tuple[Maker, ...] = (  # figs. 4b, 7b, 10b, 10c
    *((*ring, axis) for ring in (("ellipse", 0.6), ("rectangle", 0.6, 0.3)) for axis in "xy"),
    *(("triangle", math.radians(60), math.sqrt(3) / 12), ("triangle", math.radians(120), 1 / 15)),
)
PROFILES: tuple[Maker, ...] = (  # figs. 11b, D1, D2, D3
    *(("ellipse", b, axis) for b in (0.7, 0.85) for axis in "xy"),
    *(("rectangle", b, 0.3, axis) for b in (0.4, 0.8) for axis in "xy"),
    *(("rectangle", 1.0, r) for r in (0.1, 0.3, 0.6, 1.0)),
    *(("triangle", math.radians(angle), 1 / 30) for angle in (60, 75, 120)),
    *(("triangle", math.radians(120), r) for r in (0.1, math.tan(math.radians(15)) / 2)),
    SHARP,
)
SNAPS, DEAD = ({"control": name, "unload": True} for name in ("angle", "moment"))
FOLDS: dict[str, tuple[Maker, float, dict[str, Any]]] = {
    "angle": (CIRCLE, 1.6, SNAPS),
    "angle_triangle": (SHARP, 4.0, SNAPS),
    "moment": (CIRCLE, 1.6, DEAD),
    "moment_stable": (CIRCLE, 4.0, DEAD),
    "relaxation": (CIRCLE, 1.6, SNAPS | {"solver": "relaxation"}),
    "shapes": (("ellipse", 0.85, "y"), 4.0, {"shapes": True, "modes": True}),
    "falls": (CIRCLE, 1.6, {"control": "angle", "shapes": True, "history": True}),
    "full": (CIRCLE, 1.6, {"sector": "full"}),
    "half": (("rectangle", 0.6, 0.3, "x"), 4.0, {"sector": "half"}),
    "branch": (NARROW, 1.3, {"error_bars": True, "n_edges": 128}),
    "branch_full": (NARROW, 1.3, {"sector": "full"}),
    "finite": (CIRCLE, 4.0, {"stretch": "finite", "a_over_t": 50.0}),
    "tangent": (SHARP, 4.0, {"curvature": "tangent"}),
    "beyond": (CIRCLE, 1.0, {"gamma_max": 2.0 * math.pi}),
    "save_at": (SHARP, 4.0, {"save_at": (0.3, 1.0, 2.5, 3.1), "stability": False}),
    "straight": (("circle", 0.0), 2.0, {"error_bars": True}),
}
LANDSCAPES = {
    "circle": "circle --h-over-t 4",
    "ellipse": "ellipse --b-over-a 0.6 --h-over-t 4",
    "free": "circle --h-over-t 4 --free",
    "surface": "circle --h-over-t 4 --two-dimensional --cells 12",
}
DIAGRAMS = ("fig3a", "fig5b", "fig5c", "fig8b", "fig8c", "fig5a", "fig8a")  # those of cubes last


def paper(_: argparse.Namespace) -> Cases:
    """Every ring of the paper's figures, by both solvers; the circle h/t = 1 until folded too."""
    rings = [(CIRCLE, h) for h in (1.0, 1.51, 1.6, 1.84, 2.0, 3.47, 4.0, 8.0)]  # figs. 2b, C2
    rings += [(ring, h) for ring in PLAIN for h in (1.0, 2.0, 3.0, 4.0)]
    for ring, h in rings + [(ring, 4.0) for ring in PROFILES]:
        yield from both(ring, h, 128)
    yield from both(CIRCLE, 1.0, 128, until="folded")  # fig. C1


def random(wanted: argparse.Namespace) -> Cases:
    """Rings drawn over the ranges of the paper's diagrams, always the same, by both solvers."""
    draw = np.random.default_rng(2024)
    for k in range(wanted.count):
        kind, axis = str(draw.choice(["circle", "ellipse", "rectangle", "triangle"])), "xy"[k % 2]
        h, first, second = float(draw.uniform(1.0, 4.0)), *map(float, draw.uniform(size=2))
        b, apex = 0.2 + 0.8 * first, math.radians(30.0 + 90.0 * first)
        inscribed = 0.5 * math.tan(math.pi / 4 - apex / 4)
        rings: dict[str, Maker] = {
            "circle": CIRCLE,
            "ellipse": (kind, 0.5 + 0.5 * first, axis),
            "rectangle": (kind, b, 0.1 + (b - 0.1) * second, axis),
            "triangle": (kind, apex, 0.033 + (inscribed - 0.033) * second),
        }
        h = 0.2 * 300.0**first if kind == "circle" else h
        for name, make in both(rings[kind], h, 64):
            yield f"{k:03d}_{name}", make


def both(ring: Maker, h_over_t: float, n_edges: int, **more: Any) -> Cases:
    """A ring by the rod with error bars, and as a boundary-value problem."""
    import validation

    words = [word if isinstance(word, str) else f"{word:.4g}" for word in (*ring, h_over_t)]
    name = "_".join([*words, *map(str, more.values())])
    plain = partial(solved, ring, h_over_t, n_edges=n_edges, **more)
    yield f"{name}.fold", partial(plain, error_bars=True)
    yield f"{name}.bvp", partial(plain, validation.solve)


def records(_: argparse.Namespace) -> Cases:
    """A few of every other kind of record."""
    import der

    for name, (ring, h, more) in FOLDS.items():
        yield f"fold_{name}", partial(solved, ring, h, **more)
    for name, words in LANDSCAPES.items():
        yield f"landscape_{name}", partial(landscape, words)
    searches: dict[str, tuple[Callable[..., Any], bool]] = {  # with error bars or without
        "push": (partial(der.least_push, points=8), False),
        "states": (der.states, False),
        "states_in_grips": (partial(der.states, gamma=2.0), False),
        "planar": (der.planar, True),
        "squeeze": (der.squeeze, True),
        "pull": (partial(der.squeeze, distance=2.2), False),
    }
    for name, (search, bars) in searches.items():
        for ring, n in ((CIRCLE, 32), (NARROW, 64)):
            make = partial(solved, ring, 4.0, search, n_edges=n, error_bars=bars)
            yield f"{name}_{ring[0]}", make


def diagrams(wanted: argparse.Namespace) -> Cases:
    """The paper's phase diagrams; those of another resolution have other names."""
    for name in DIAGRAMS:
        full = name if wanted.finest is None else f"{name}_{wanted.finest}"
        yield full, partial(diagram, name, wanted, wanted.folder / "diagrams" / full)


def solved(ring: Maker, h_over_t: float, how: Any = None, **more: Any) -> Any:
    """The record of a ring by `der.fold`, or by what else takes a scene."""
    import der

    shape, *given = ring
    scene = der.Scene(getattr(der, shape)(*given), der.rectangular_section(h_over_t), **more)
    return (how or der.fold)(scene)


def landscape(words: str) -> Any:
    """The record that a command writes."""
    with tempfile.TemporaryDirectory() as folder:
        file = File(folder) / "record.json"
        command = ["-m", "der", "landscape", *words.split(), "--quiet", "--json", str(file)]
        code = subprocess.run([sys.executable, *command], check=False).returncode
        if code not in (0, 3):
            raise RuntimeError(f"der landscape {words}: exit code {code}")
        return json.loads(file.read_text())


def diagram(name: str, wanted: argparse.Namespace, folder: File) -> Any:
    """The tables of a diagram; its cases are kept in a folder, for when it is stopped."""
    command = ["-m", "der", "phase", name, "--quiet", "--resume", "--out", str(folder)]
    command += ["--workers", str(wanted.workers)]
    command += [] if wanted.finest is None else ["--finest", str(wanted.finest)]
    subprocess.run([sys.executable, *command], check=True)
    tables = {}
    for table in ("cases", "boundaries", "corners"):
        with (folder / f"{table}.csv").open(newline="") as rows:
            tables[table] = list(csv.DictReader(rows))
    return tables


GROUPS = {"paper": paper, "random": random, "records": records, "diagrams": diagrams}


def dump(wanted: argparse.Namespace) -> None:
    """Write the records that are not yet there."""
    import der

    if wanted.tree.resolve() not in File(str(der.__file__)).resolve().parents:
        raise SystemExit(f"der must be that of {wanted.tree}, got {der.__file__}")
    done = 0
    for group in wanted.only.split(","):
        (wanted.folder / group).mkdir(parents=True, exist_ok=True)
        for name, make in GROUPS[group](wanted):
            file = wanted.folder / group / f"{name}.json"
            if wanted.match not in name or file.exists():
                continue
            half = file.with_suffix(".part")
            half.write_text(json.dumps(entries(make)))
            half.replace(file)
            done += 1
            if done % 20 == 0:
                print(f"{done} cases, the last {group}/{name}", file=sys.stderr, flush=True)
    print(f"{done} cases written to {wanted.folder}", file=sys.stderr)


def entries(make: Callable[[], Any]) -> Any:
    """JSON entries of a record, unfinished or not, with the vertices of a path that has shapes."""
    import der

    try:
        found = make()
    except der.NotConverged as unfinished:
        found = unfinished.path
    except (ValueError, RuntimeError, ArithmeticError) as wrong:
        return {"raised": type(wrong).__name__, "message": str(wrong)}
    if not hasattr(found, "to_json"):
        return found
    written = json.loads(found.to_json())
    if isinstance(found, der.Path) and found.shapes is not None:
        written |= {"x": found.shapes.x.tolist(), "frames": found.shapes.frames.tolist()}
    return written


# --- Compare ---------------------------------------------------------------------------------

CLOSE = 1e-9  # of the largest value of a column
LEAST = 1e-3  # least value used for it: a smaller column is rounding
CONTACT = 1e-5  # likewise, for self-crossings, which are bisected to that
BARS = 0.1  # of an estimated error, where it changes by more than CLOSE
CORNER = 1e-7  # of the sides of a diagram
CURVE = 2e-5  # likewise; see `validation.boundaries`
STATES = {"gamma", "moment", "energy", "index", "index_moment", "x", "frames"}  # columns of a path
STATES |= {"distance", "force", "force_error", "energy_error"}  # and of a squeezed ring
NOT_JUDGED = {
    *("timing", "version", "tried", "nowhere", "force_evaluations", "residual", "intervals"),
    *("message", "how", "why", "position", "curve", "way", "path", "snaps"),
}
SIZES = ("value", "contact", "error", "curve", "corner")
Leaf = tuple[Any, str, bool]  # a value, its column, and whether it is an error of such values


class Found(NamedTuple):
    """The change of an entry, the largest change allowed, and both in words."""

    kind: str  # one of SIZES, or "other" for what may not differ at all
    size: float  # of the column's largest value; of the old error; of the diagram's sides
    allowed: float
    words: str


def compare(old: File, new: File, groups: Sequence[str]) -> int:
    """Print how much the new records differ from the old ones, and which cases differ too much."""
    lines, total = [], 0
    print("group      cases  equal" + "".join(f"{kind:>10}" for kind in SIZES))
    for group in [old / name for name in groups if (old / name).is_dir()]:
        files = sorted(group.glob("*.json"))
        largest, equal = dict.fromkeys((*SIZES, "other"), 0.0), 0
        for file in files:
            found = list(judged(file, new / group.name / file.name))
            largest |= {kind: max(largest[kind], size) for kind, size, _, _ in sorted(found)}
            wrong = [one.words for one in found if not one.size <= one.allowed]
            equal += not wrong
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            lines += [f"{group.name}/{file.stem}: {words}{more}" for words in wrong[:1]]
        total += len(files)
        sizes = "".join(f"{largest[kind]:10.1e}" for kind in SIZES)
        print(f"{group.name:<10} {len(files):5d}  {equal:5d}{sizes}")
    print("\n".join(lines[:40] if total else [f"there are no records in {old}"]))
    return 3 if lines or not total else 0


def judged(old_file: File, new_file: File) -> Iterator[Found]:
    """The change of every entry of a record."""
    if not new_file.exists():
        yield Found("other", math.inf, 0.0, "there is no such new record")
        return
    old, new = (json.loads(file.read_text()) for file in (old_file, new_file))
    if "boundaries" in old and "boundaries" in new:
        yield from judged_diagram(old, new)
        return
    scale: dict[str, float] = defaultdict(lambda: LEAST)
    for _, (value, column, bar) in leaves(old):
        if isinstance(value, float) and not bar:
            scale[column] = max(scale[column], abs(value))
    scale["slope"] = max(scale["slope"], scale["moment"])
    there = dict(leaves(asked(new)))
    points = [point["kind"] for point in old.get("points", [])]
    contacts = tuple(f"points[{k}]." for k, kind in enumerate(points) if kind == "contact")
    for place, leaf in leaves(asked(old)):
        one = judged_leaf(place, leaf, there.get(place), scale[leaf[1]])
        if one.kind == "value" and place.startswith(contacts):
            one = one._replace(kind="contact", allowed=CONTACT)
        yield one


def judged_leaf(place: str, old: Leaf, new: Leaf | None, scale: float) -> Found:
    """The change of one entry; ``scale`` is the largest value of its column."""
    was, now = old[0], None if new is None else new[0]
    words = f"{place} was {was!r}, is {'missing' if new is None else repr(now)}"
    if not (isinstance(was, float) and isinstance(now, float)):
        return Found("other", 0.0 if new is not None and was == now else math.inf, 0.0, words)
    off = abs(now - was)
    if not old[2]:
        return Found("value", off / scale, CLOSE, words)
    ratio = off / max(abs(was), sys.float_info.min)
    return Found("error", ratio if off > CLOSE * scale else 0.0, BARS, words)


def leaves(
    entry: Any, place: str = "", column: str = "", bar: bool = False
) -> Iterator[tuple[str, Leaf]]:
    """Every value of an entry that is checked, by place, and the lengths of lists."""
    if isinstance(entry, dict):
        for name in [name for name in entry if name not in NOT_JUDGED]:
            own = name.removesuffix("_error").removesuffix("_at_pi")
            own = column if own in ("value", "error") else own
            inner = f"{place}.{name}".strip(".")
            yield from leaves(entry[name], inner, own, bar or "error" in name)
    elif isinstance(entry, list):
        yield f"{place}.length", (len(entry), column, bar)
        for k, inner in enumerate(entry):
            yield from leaves(inner, f"{place}[{k}]", column, bar)
    else:
        yield place, (entry, column, bar)


def asked(record: dict[str, Any]) -> dict[str, Any]:
    """A record without the states of its path that nobody asked for."""
    squeezed = "goal" in record
    way = record.get("distance" if squeezed else "gamma")
    if not isinstance(way, list) or record.get("kind") == "surface":
        return record
    wanted = record["numerics"].get("save_at") or np.arange(-80, 81) * (math.pi / 8)
    gaps = np.abs(np.subtract.outer(way, [*wanted, math.pi])).min(axis=1, initial=math.inf)
    kept = sorted({0, len(way) - 1}) if squeezed else np.flatnonzero(gaps < 1e-12).tolist()

    def chosen(entry: dict[str, Any]) -> dict[str, Any]:
        own = {name for name in STATES & set(entry) if isinstance(entry[name], list)}
        return entry | {name: [entry[name][k] for k in kept] for name in own}

    inner = {name: chosen(record[name]) for name in ("error", "raw") if record.get(name)}
    return chosen(record) | inner


def judged_diagram(old: dict[str, Any], new: dict[str, Any]) -> Iterator[Found]:
    """The changes of labels, boundaries and corners of a diagram."""
    from validation.boundaries import case_of, lines_of, off_lines, place_of

    sides = np.ptp([place_of(row) for row in old["cases"]], axis=0)
    sides[sides == 0.0] = 1.0
    before, after = ({case_of(row): row["label"] for row in d["cases"]} for d in (old, new))
    for case, was in before.items():
        yield judged_leaf(case, (was, "", False), (after.get(case), "", False), 1.0)
    for table, kind, allowed in (("boundaries", "curve", CURVE), ("corners", "corner", CORNER)):
        ours, theirs = (lines_of(diagram[table], sides) for diagram in (old, new))
        for some, others, none in ((ours, theirs, "is none now"), (theirs, ours, "was none")):
            for place, size in off_lines(some, others):
                yield Found(kind, size, allowed, f"{place} {none}: {size:.1e} off")


# --- The command -----------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit code."""
    parser = argparse.ArgumentParser(
        "regression", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    dumps, compares = commands.add_parser("dump"), commands.add_parser("compare")
    for one in (dumps, compares):
        one.add_argument("--only", default=",".join(GROUPS), help="groups of cases")
    dumps.add_argument("folder", type=File)
    dumps.add_argument("--tree", type=File, default=File.cwd(), help="the checkout to ask")
    dumps.add_argument("--match", default="", help="cases with this in their names only")
    dumps.add_argument("--count", type=int, default=200, help="of random rings")
    dumps.add_argument("--finest", type=int, help="cells along a side of a diagram: 64, cubes 32")
    dumps.add_argument("--workers", type=int, default=1, help="processes for a diagram")
    dumps.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    compares.add_argument("old", type=File)
    compares.add_argument("new", type=File)
    given = list(sys.argv[1:] if arguments is None else arguments)
    wanted = parser.parse_args(given)
    if not set(wanted.only.split(",")) <= set(GROUPS):
        parser.error(f"--only must be of {','.join(GROUPS)}, got {wanted.only}")
    if wanted.command == "compare":
        return compare(wanted.old, wanted.new, wanted.only.split(","))
    if wanted.here:
        dump(wanted)
        return 0
    # a process that imports neither this checkout nor the folder that it is started in
    alone = {"PYTHONPATH": str(wanted.tree.resolve()), "PYTHONSAFEPATH": "1"}
    env = os.environ | alone | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, __file__, *given, "--here"]
    return subprocess.run(command, env=env, check=False).returncode


if __name__ == "__main__":
    raise SystemExit(main())
