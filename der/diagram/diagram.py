"""Phase diagrams of folding modes: scanned, their boundaries followed, drawn and tabled.

    diagram = phase_diagram("fig3a", "out/fig3a", resume=True)

New Python processes are started, so a script calls this under ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import csv
import io
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from der.diagram.cases import LABELS, PARAMETERS, Row, solve_case
from der.diagram.families import FAMILIES, Family, family
from der.diagram.rod_check import Compared, Fold, rod_check, table
from der.diagram.scan import Scan, Solve, scan
from der.diagram.scanned_boundaries import Corner, Curve
from der.diagram.store import Store
from der.diagram.workers import Workers
from der.diagram.workers import workers as started
from der.records.record import Shown
from der.utils.files import FilePath, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from der.diagram.curves.slices import Boundaries

__all__ = ["FAMILIES", "PhaseDiagram", "phase_diagram"]

STORE = "cases.sqlite"
LATER = ("der.diagram.distributed", "der.viz.plots.phase_diagram")  # what the scan does not need
SAMPLE = 40

Entries: TypeAlias = dict[str, Any]  # of a line of a table, by column; others are left out


@dataclass(frozen=True, repr=False)
class PhaseDiagram(Shown):
    """A phase diagram.

    Attributes
    ----------
    scan : its cases; `scan.sorted_rows` has each once
    curves : boundaries between folding modes
    corners : where two of them meet
    compared : cases by the rod, too, where that was asked for
    files : what was written
    seconds : what it took: the scan, the boundaries, the check
    """

    NAME: ClassVar[str] = "phase diagram"

    scan: Scan
    curves: tuple[Curve, ...]
    corners: tuple[Corner, ...]
    compared: tuple[Compared, ...]
    files: tuple[File, ...]
    seconds: tuple[float, ...]

    @property
    def family(self) -> Family:
        """What was scanned."""
        return self.scan.family

    def facts(self) -> list[str]:
        """Which family, and how much is known of it."""
        sizes = (f"{len(self.rows)} cases", f"{len(self.curves)} boundaries")
        return [self.family.name, *sizes, f"{len(self.corners)} corners"]

    def figure(self) -> Figure:
        """The regions of folding modes and their boundaries."""
        from der.diagram.picture import picture
        from der.viz.plots.phase_diagram import draw

        return draw(picture(self.scan, self.curves))

    @property
    def rows(self) -> tuple[Row, ...]:
        """How every case folds."""
        return self.scan.sorted_rows


def phase_diagram(
    name: str,
    folder: FilePath,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    nu: float = 0.3,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    check: Fold | None = None,
    sample: int = SAMPLE,
    finest: int | None = None,
    progress: bool = True,
    solve: Solve = solve_case,
) -> PhaseDiagram:
    """The phase diagram of a family of rings, written to a folder.

    Every finished case is in `cases.sqlite` at once, so that a run that is stopped and resumed
    loses only the cases in flight. Afterwards `cases.csv`, `boundaries.csv`, `corners.csv`,
    NAME.png, and `check.csv` are written.

    Parameters
    ----------
    name : of FAMILIES
    folder : where the files go; made if it is not there
    workers : processes, None: one a core
    scheduler : address of a Dask scheduler whose workers are used instead
    resume : go on with the cases that the folder has
    nu : Poisson's ratio
    ranges : first and last value of parameters in place of the family's own, by name
    check : a solver such as `der.fold`, asked about a sample of the cases
    sample : how many
    finest : intervals along each parameter at the finest level, a power of two
    progress : whether to show a bar, on a terminal
    solve : the row of a case, see `scan`

    Raises
    ------
    ValueError
        For an argument that is not allowed, by name; a folder with cases, unless it is to resume.
    Interrupted
        At Ctrl-C. What was finished is kept.
    OSError
        On a full disk. What was finished is kept.
    RuntimeError
        If workers cannot work.
    """
    wanted = family(name, nu=nu, ranges=ranges, finest=finest)
    if isinstance(sample, bool) or not isinstance(sample, int) or sample < 1:
        raise ValueError(f"sample must be an integer from 1, got {sample!r}")
    folder = File(folder)
    clock = [time.perf_counter()]  # at the start, and after each part
    with started(workers, scheduler) as crew, Store(_made(folder) / STORE) as store:
        if len(store) and not resume:
            raise ValueError(
                f"resume must be asked for in a folder that has cases, {folder} has {len(store)}"
            )
        crew.start()
        for module in LATER:  # while they start
            import_module(module)
        found = scan(wanted, store, crew, solve=solve, progress=progress)
        clock.append(time.perf_counter())
        cases = _write(folder / "cases.csv", CASE_COLUMNS, map(_of_case, found.sorted_rows))
        bounds = _followed(found, store, crew, solve)
        beside = [row for row in store.rows.values() if wanted.unit(row.case) is not None]
    clock.append(time.perf_counter())
    compared = () if check is None else rod_check(found, check, sample)
    clock.append(time.perf_counter())
    files = (cases, *_written(folder, found, bounds, compared, beside))
    seconds = tuple(after - before for before, after in pairwise(clock))
    curves, corners = tuple(bounds.curves), tuple(bounds.corners)
    return PhaseDiagram(found, curves, corners, compared, files, seconds)


def _followed(found: Scan, store: Store, crew: Workers, solve: Solve) -> Boundaries:
    """The boundaries of a scan, see `der.diagram.distributed`."""
    from der.diagram.distributed import follow

    return follow(found, store, crew, solve)


def doubts(diagram: PhaseDiagram) -> list[str]:
    """What the boundaries of a diagram lack, a line each; none if they are complete."""
    from der.diagram.distributed import loose_ends, unexplained

    family, curves = diagram.family, diagram.curves
    lines = []
    if left := unexplained(diagram.scan, curves):
        lines.append(f"edges of the scan without a boundary within 1.5 cells: {left}")
    if ends := loose_ends(family, curves, diagram.corners):
        case = ends[0].case
        place = ", ".join(f"{name} = {getattr(case, name):.6g}" for name in family.parameters)
        lines.append(
            f"loose ends of boundaries: {len(ends)}, the first with {place}, "
            f"about {case.twist_axis}"
        )
    return lines


def summary(diagram: PhaseDiagram) -> str:
    """Cases by label, what it took, and what was written, in a few lines."""
    rows = diagram.rows
    count = Counter(row.label for row in rows)
    taken = "scan {:.1f}s, boundaries {:.1f}s, check {:.1f} s".format(*diagram.seconds)
    name, solved = diagram.family.name, diagram.scan.solved
    lines = [f"{name}: {len(rows)} cases, {solved} solved now ({taken})"]
    lines += [f"  {count[label]:6d}  {label}" for label in LABELS if count[label]]
    if bad := [row for row in rows if not row.ok]:
        lines.append(f"  {len(bad):6d}  failed, the first: {bad[0].message}")
    kinds = Counter(curve.kind for curve in diagram.curves)
    words = [f"{n} {kind}" for kind, n in kinds.items()]
    lines.append(f"boundaries: {', '.join(words)}; {len(diagram.corners)} corners")
    if diagram.compared:
        lines.append(table(diagram.compared))
    return "\n".join([*lines, *map(str, diagram.files)])


def _made(folder: FilePath) -> File:
    """The folder, made unless it is there."""
    folder = File(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(
            f"folder must be one that can be made, got {str(folder)!r}: {reason}"
        ) from problem
    return folder


# --- Files -----------------------------------------------------------------------------------


def _written(
    folder: File,
    found: Scan,
    bounds: Boundaries,
    compared: tuple[Compared, ...],
    beside: Sequence[Row],
) -> tuple[File, ...]:
    """Write boundaries, check and picture; the table of cases is already there."""
    from der.diagram.picture import picture
    from der.viz.plots.phase_diagram import draw
    from der.viz.plots.style import save

    curves, corners = bounds
    files = [
        _write(folder / "boundaries.csv", BOUNDARY_COLUMNS, _of_boundaries(curves)),
        _write(folder / "corners.csv", CORNER_COLUMNS, map(_of_corner, corners)),
    ]
    if compared:
        files.append(_write(folder / "check.csv", CHECK_COLUMNS, map(_of_check, compared)))
    file = folder / f"{found.family.name}.png"
    save(draw(picture(found, curves, beside)), file)
    return (*files, file)


POINT_COLUMNS = ("twist_axis", *PARAMETERS, "gamma", "moment", "error")
BOUNDARY_COLUMNS = ("boundary", *POINT_COLUMNS, "curve")
CORNER_COLUMNS = ("boundary", "other", *POINT_COLUMNS)
CASE_COLUMNS = (
    *(
        "shape",
        "twist_axis",
        *PARAMETERS,
        "label",
        "foldable",
        "stable",
        "stays_folded",
        "snapping",
    ),
    *("moment", "slope", "folds", "error", "status", "message"),
)
CHECK_COLUMNS = (
    *("shape", "twist_axis", *PARAMETERS, "where", "agrees", "bvp", "rod"),
    *("moment_bvp", "moment_rod", "slope_bvp", "slope_rod", "message"),
)


def _of_case(row: Row) -> Entries:
    """Entries of a case. Its time is no column, so that the same cases are the same file."""
    return vars(row.case) | vars(row)


def _of_boundaries(curves: Iterable[Curve]) -> Iterator[Entries]:
    for n, curve in enumerate(curves):
        own = {"boundary": curve.kind, "twist_axis": curve.twist_axis, "curve": str(n)}
        for point in curve.points:
            yield vars(point.case) | vars(point) | own


def _of_corner(corner: Corner) -> Entries:
    first, *others = corner.kinds
    own = {"boundary": first, "other": " + ".join(others), "twist_axis": corner.twist_axis}
    return vars(corner.point.case) | vars(corner.point) | own


def _of_check(pair: Compared) -> Entries:
    where = {"where": "near" if pair.near else "away", "agrees": pair.agrees}
    entries = vars(pair.bvp.case) | where | {"message": pair.rod.message}
    for name, row in (("bvp", pair.bvp), ("rod", pair.rod)):
        entries |= {name: row.label, f"moment_{name}": row.moment, f"slope_{name}": row.slope}
    return entries


def _text(value: Any) -> str:
    """A cell: numbers come back bit for bit, and one that is not known is empty."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return " ".join(map(repr, value))
    return "" if value is None or not math.isfinite(value) else repr(float(value))


def _write(file: File, columns: Sequence[str], rows: Iterable[Entries]) -> File:
    text = io.StringIO(newline="")
    table_of = csv.writer(text, lineterminator="\n")
    table_of.writerow(columns)
    table_of.writerows([_text(entries[name]) for name in columns] for entries in rows)
    content = text.getvalue().encode()
    write_whole(file, lambda opened: opened.write(content))
    return file
