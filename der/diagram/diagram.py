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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import TYPE_CHECKING, ClassVar

from der.diagram.cases import LABELS, PARAMETERS, Case, Row, solve_case
from der.diagram.curves.slices import Boundaries
from der.diagram.distributed import follow, loose_ends, unexplained
from der.diagram.families import FAMILIES, Family, family
from der.diagram.rod_check import Compared, Fold, rod_check, table
from der.diagram.scan import Scan, Solve, scan
from der.diagram.scanned_boundaries import Corner, Curve
from der.diagram.store import Store
from der.diagram.workers import workers as started
from der.records.record import Shown
from der.utils.files import FilePath, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FAMILIES", "PhaseDiagram", "phase_diagram"]

STORE = "cases.jsonl"
SAMPLE = 40


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
    seconds: tuple[float, float, float]

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

    Every finished case is in `cases.jsonl` at once, so that a run that ends in whatever way, and is
    resumed, loses none but those in flight. Afterwards `cases.csv`, `boundaries.csv`,
    `corners.csv`, NAME.png, and `check.csv` are written.

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
    folder = _made(folder)
    clock = [time.perf_counter()]
    with Store(folder / STORE) as store, started(workers, scheduler) as crew:
        if len(store) and not resume:
            raise ValueError(
                f"resume must be asked for in a folder that has cases, {folder} has {len(store)}"
            )
        found = scan(wanted, store, crew, solve=solve, progress=progress)
        clock.append(time.perf_counter())
        cases = _write(folder / "cases.csv", CASE_COLUMNS, map(_case_cells, found.sorted_rows))
        bounds = follow(found, store, crew, solve)
        beside = [row for row in store.rows.values() if wanted.unit(row.case) is not None]
    clock.append(time.perf_counter())
    compared = () if check is None else rod_check(found, check, sample)
    clock.append(time.perf_counter())
    files = (cases, *_written(folder, found, bounds, compared, beside))
    seconds = (clock[1] - clock[0], clock[2] - clock[1], clock[3] - clock[2])
    return PhaseDiagram(
        found, tuple(bounds.curves), tuple(bounds.corners), compared, files, seconds
    )


def doubts(diagram: PhaseDiagram) -> list[str]:
    """In what the boundaries of a diagram are not complete, a line each; none if they are."""
    family, curves = diagram.family, diagram.curves
    lines = []
    if left := unexplained(diagram.scan, curves):
        lines.append(f"edges of the scan without a boundary within 1.5 cells: {left}")
    if ends := loose_ends(family, curves, diagram.corners):
        case = ends[0].case
        place = ", ".join(f"{name} = {getattr(case, name):.6g}" for name in family.parameters)
        lines.append(
            f"ends of boundaries that lead nowhere: {len(ends)}, the first with {place}, "
            f"about {case.twist_axis}"
        )
    return lines


def summary(diagram: PhaseDiagram) -> str:
    """Cases by label, what it took, and what was written, in a few lines."""
    rows = diagram.rows
    count = Counter(row.label for row in rows)
    taken = "s, ".join(
        f"{words} {seconds:.1f}"
        for words, seconds in zip(("scan", "boundaries", "check"), diagram.seconds, strict=True)
    )
    lines = [
        f"{diagram.family.name}: {len(rows)} cases, {diagram.scan.solved} solved now ({taken} s)"
    ]
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
    """Write boundaries, check and picture; the table of cases has long been written."""
    from der.diagram.picture import picture
    from der.viz.plots.phase_diagram import draw
    from der.viz.plots.style import save

    curves, corners = bounds
    files = [
        _write(folder / "boundaries.csv", BOUNDARY_COLUMNS, _boundary_cells(curves)),
        _write(folder / "corners.csv", CORNER_COLUMNS, map(_corner_cells, corners)),
    ]
    if compared:
        files.append(_write(folder / "check.csv", CHECK_COLUMNS, map(_check_cells, compared)))
    file = folder / f"{found.family.name}.png"
    save(draw(picture(found, curves, beside)), file)
    return (*files, file)


MODE_COLUMNS = ("label", "foldable", "stable", "snapping", "moment", "slope", "folds", "error")
CASE_COLUMNS = ("shape", "twist_axis", *PARAMETERS, *MODE_COLUMNS, "status", "message")
BOUNDARY_COLUMNS = ("boundary", "twist_axis", *PARAMETERS, "gamma", "moment", "error", "curve")
CORNER_COLUMNS = ("boundary", "other", "twist_axis", *PARAMETERS, "gamma", "moment", "error")
CHECK_COLUMNS = (
    *("shape", "twist_axis", *PARAMETERS, "where", "agrees", "bvp", "rod"),
    *("moment_bvp", "moment_rod", "slope_bvp", "slope_rod", "message"),
)


def _case_cells(row: Row) -> list[str]:
    """What a case took is left out, so that the same cases are the same file."""
    folds = " ".join(map(repr, row.folds))
    mode = [row.label, _word(row.foldable), _word(row.stable), row.snapping]
    mode += [_number(row.moment), _number(row.slope), folds, _number(row.error)]
    return [row.case.shape, row.case.twist_axis, *_values(row.case), *mode, row.status, row.message]


def _boundary_cells(curves: Iterable[Curve]) -> Iterable[list[str]]:
    for n, curve in enumerate(curves):
        for point in curve.points:
            numbers = map(_number, (point.gamma, point.moment, point.error))
            yield [curve.kind, curve.twist_axis, *_values(point.case), *numbers, str(n)]


def _corner_cells(corner: Corner) -> list[str]:
    point = corner.point
    numbers = map(_number, (point.gamma, point.moment, point.error))
    kinds = corner.kinds[0], " + ".join(corner.kinds[1:])
    return [*kinds, corner.twist_axis, *_values(point.case), *numbers]


def _check_cells(pair: Compared) -> list[str]:
    bvp, rod = pair.bvp, pair.rod
    numbers = map(_number, (bvp.moment, rod.moment, bvp.slope, rod.slope))
    verdict = ["near" if pair.near else "away", _word(pair.agrees), bvp.label, rod.label]
    case = bvp.case
    return [case.shape, case.twist_axis, *_values(case), *verdict, *numbers, rod.message]


def _values(case: Case) -> list[str]:
    return [_number(getattr(case, name)) for name in PARAMETERS]


def _number(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else repr(float(value))


def _word(truth: bool) -> str:
    return "true" if truth else "false"


def _write(file: File, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> File:
    text = io.StringIO(newline="")
    table_of = csv.writer(text, lineterminator="\n")
    table_of.writerow(columns)
    table_of.writerows(rows)
    content = text.getvalue().encode()
    write_whole(file, lambda opened: opened.write(content))
    return file
