"""The command `der`: the roof over the packages.

Exit codes: 0 done; 2 bad input, in one line that names the option, the value and what is allowed;
3 not converged, with the last good state saved and named; 130 stopped by Ctrl-C, likewise saved.
"""

from __future__ import annotations

import atexit
import math
import signal
import sys
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Annotated, Any

import typer

from der.cli.options import (
    NU,
    FileOptions,
    LiveOptions,
    PathOptions,
    RingOptions,
    command,
    number_option,
    options_named,
    whole,
)
from der.cli.output import check_named, check_writable, say, show, targets
from der.cli.run import counted, finish, follow, hand_over, keep_showing, progress, served

if TYPE_CHECKING:
    from collections.abc import Callable

    from der.records.path import Path
    from der.scene import Scene

app = typer.Typer(
    help="Discrete elastic rods for rings that fold by twisting.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave with its exit code."""
    from der.utils.interrupts import interrupts_heard

    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        with interrupts_heard():
            code = _run(arguments or ["--help"])
    except typer.TyperException as wrong:
        text = " ".join(str(getattr(wrong, "message", wrong)).split())
        if hasattr(wrong, "format_message"):
            text = " ".join(wrong.format_message().split())
        say(f"der: {text}")
        code = 2
    except (typer.Abort, KeyboardInterrupt) as stopped:
        # a second Ctrl-C in the midst of leaving would leave semaphores behind
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        say(f"der: {str(stopped) or 'stopped by the user'}")
        code = 130
    except (OSError, RuntimeError) as wrong:  # a full disk; workers that cannot work
        say(f"der: {wrong}")
        code = 3
    sys.exit(code or 0)


def _run(arguments: list[str]) -> int:
    """Run the command as typer does, which says nothing about Ctrl-C."""
    command = typer.main.get_command(app)
    try:
        with command.make_context("der", list(arguments)) as context:
            code: int | None = command.invoke(context)
    except typer.Exit as done:
        code = done.exit_code
    return code or 0


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"der {version('ring-origami')}")
        raise typer.Exit


@app.callback()
def _top(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Say the version."),
    ] = False,
) -> None:
    """Discrete elastic rods for rings that fold by twisting."""


# --- The commands ----------------------------------------------------------------------------


@command(app, RingOptions, PathOptions, FileOptions, LiveOptions)
def fold(ring: RingOptions, path: PathOptions, files: FileOptions, watch: LiveOptions) -> int:
    """Fold a ring: the path of equilibria from flat on, its folds, and the index of every state."""
    with options_named():
        playback = watch.live or files.rrd is not None
        other = files.other()
        scene = path.scene(
            ring,
            shapes=playback or files.drawn,
            history=playback or files.moving,
            modes=playback and path.stability and path.solver == "newton",
        )
        written = files.targets()
        serving = served(watch.port) if watch.live else nullcontext()
    from der.analysis.fold import fold as solve

    with serving as shown:

        def run(tick: Callable[[float], object] | None) -> Path:
            return solve(scene, progress=tick, watch=None if shown is None else shown.show)

        found, code = follow(run, scene, written, other, quiet=files.quiet)
        if shown is not None and len(found) and found.status != "interrupted":
            keep_showing(shown, found)
    return code


@command(app, RingOptions, PathOptions, FileOptions)
def bvp(ring: RingOptions, path: PathOptions, files: FileOptions) -> int:
    """Solve the boundary-value problem: the same path, to the error that you ask for."""
    with options_named():
        from der.bvp.solve import TOLERANCE, check, solve_bvp

        tolerance = TOLERANCE if path.tolerance is None else path.tolerance
        scene = path.scene(ring, shapes=files.drawn, error_bars=False, tolerance=1e-10)
        check(scene, tolerance)
        written = files.targets()
        other = files.other()

    def run(tick: Callable[[float], object] | None) -> Path:
        return solve_bvp(scene, tolerance=tolerance, progress=tick)

    return follow(run, scene, written, other, quiet=files.quiet)[1]


@dataclass(frozen=True)
class ComparisonFiles:
    """What a comparison writes."""

    json: Annotated[
        str | None, typer.Option(metavar="F", help="Write both records and differences here.")
    ] = None
    plot: Annotated[
        str | None, typer.Option(metavar="F", help="Draw both: .png, .pdf or .svg.")
    ] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write comparison.json and .png here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no table.")] = False


@command(app, RingOptions, PathOptions, ComparisonFiles)
def compare(ring: RingOptions, path: PathOptions, files: ComparisonFiles) -> int:
    """Hold the rod against the boundary-value problem, state by state, with their error bars."""
    with options_named():
        from der.bvp.solve import TOLERANCE, check

        check(path.scene(ring, error_bars=False), TOLERANCE)  # what the other solver cannot do
        scene = path.scene(ring, error_bars=True)
        written = targets(files.json, files.plot, None, files.out, stem="comparison", shapes=False)
    from der.analysis.compare import compare as compared
    from der.analysis.compare import table
    from der.analysis.fold import fold as solve
    from der.errors import Interrupted, NotConverged

    try:
        with progress(scene, quiet=files.quiet) as tick:
            found = compared(scene, solve(scene, progress=tick), progress=tick)
    except (NotConverged, Interrupted) as unfinished:
        code = 3 if isinstance(unfinished, NotConverged) else 130
        return finish(unfinished.path, {}, code, quiet=files.quiet)

    def plot(file: File) -> None:
        from der.viz.plots.comparison import save_comparison

        save_comparison(found, file)

    return hand_over(found, written, 0, {"plot": plot}, lambda: table(found), quiet=files.quiet)


@app.command()
def figure(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="fig2b, fig3b, ..., hysteresis; all; or diagrams."),
    ],
    out: Annotated[str, typer.Option(metavar="DIR", help="The folder to write to.")],
    workers: Annotated[
        int | None, typer.Option(parser=whole, help="Processes; one a core if not given.")
    ] = None,
) -> None:
    """Draw the paper's figures: PNG, and the data as CSV. Diagrams are the phase diagrams."""
    with options_named():
        check_named(out=out)
        from der.paper import DIAGRAMS, FIGURES, Interrupted, draw

        several = {"all": list(FIGURES), "diagrams": list(DIAGRAMS)}
        chosen = several.get(" ".join(names), names)
        try:
            drawn = draw(chosen, out, workers=workers, warn=lambda words: say(f"der: {words}"))
        except Interrupted as stopped:
            drawn, code = stopped.drawn, 130
        else:
            code = 3 if drawn.failed else 0
    written = [file for files in drawn.written.values() for file in files]
    for file in written:
        show(str(file))
    for name, reason in drawn.failed.items():
        say(f"der: {name} failed: {reason}")
    raise typer.Exit(code)


CELLS = 60  # along each side of a surface


@dataclass(frozen=True)
class LandscapeOptions:
    """Which landscape, and what is written."""

    two_dimensional: Annotated[
        bool, typer.Option("--two-dimensional", help="Over twist and grip distance.")
    ] = False
    free: Annotated[bool, typer.Option("--free", help="The barrier with the grips removed.")] = (
        False
    )
    push: Annotated[
        bool, typer.Option("--push", help="The forces or couples that open it with least work.")
    ] = False
    cells: Annotated[
        int, typer.Option(parser=whole, help="Along each side, with --two-dimensional.")
    ] = CELLS
    json: Annotated[str | None, typer.Option(metavar="F", help="Write it here ('-': output).")] = (
        None
    )
    plot: Annotated[str | None, typer.Option(metavar="F", help="Draw it: .png, .pdf, .svg.")] = None
    rrd: Annotated[
        str | None,
        typer.Option(metavar="F", help="Record it with the ring for playback with rerun: .rrd."),
    ] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write landscape.json and .png here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False


@command(app, RingOptions, PathOptions, LandscapeOptions)
def landscape(ring: RingOptions, path: PathOptions, wanted: LandscapeOptions) -> int:
    """Map the energy: rests, wells, saddles, and barriers to fold the ring and to open it."""
    with options_named():
        _check_landscape(path, wanted)
        scene = path.scene(ring, error_bars=not wanted.two_dimensional)
        if wanted.rrd is not None and not wanted.two_dimensional:
            scene = _with_shapes(scene)
        written = targets(
            wanted.json, wanted.plot, wanted.rrd, wanted.out, stem="landscape", shapes=False
        )
        from der.analysis.landscape.landscape import landscape as curve

        found: Any
        with progress(scene, quiet=wanted.quiet) as tick:
            if wanted.two_dimensional:
                from der.analysis.landscape.surface import energy_surface

                found = energy_surface(scene, shape=(wanted.cells, wanted.cells), progress=tick)
            elif wanted.push:
                from der.analysis.landscape.opening import least_push

                found = least_push(scene, progress=tick)
            elif wanted.free:
                from der.analysis.landscape.barrier import barrier

                found = barrier(scene)
            else:
                found = curve(scene, progress=tick)
    from der.cli.drawings import of_landscape
    from der.records.landscape_text import reason, words

    def along() -> Any:
        return curve(_with_shapes(scene), index_free=False) if wanted.two_dimensional else found

    code = {"done": 0, "interrupted": 130}.get(found.status, 3)
    return hand_over(
        found,
        written,
        code,
        of_landscape(found, along),
        lambda: words(found, why=not code),
        unfinished=f"{reason(found)}; what was found is",
        quiet=wanted.quiet,
    )


def _check_landscape(path: PathOptions, wanted: LandscapeOptions) -> None:
    """Refuse options that a landscape of this kind would not look at."""
    modes = {
        "--two-dimensional": wanted.two_dimensional,
        "--free": wanted.free,
        "--push": wanted.push,
    }
    kinds = [name for name, is_given in modes.items() if is_given]
    if len(kinds) > 1:
        raise ValueError(f"{kinds[-1][2:]} cannot be given together with {kinds[0]}, got both")
    if not 3 <= wanted.cells <= 1000:
        raise ValueError(f"cells must be from 3 to 1000, got {wanted.cells}")
    if wanted.cells != CELLS and not wanted.two_dimensional:
        raise ValueError(f"cells must go with --two-dimensional, got {wanted.cells} alone")
    if wanted.rrd is not None and (wanted.free or wanted.push):
        raise ValueError(f"rrd cannot be given together with {kinds[0]}, got {wanted.rrd!r}")
    if path.control != "arclength":
        raise ValueError(f"control must be 'arclength' for a landscape, got {path.control!r}")
    if path.gamma_max != math.pi:
        raise ValueError(
            "gamma_max cannot be given for a landscape, which ends where the ring has folded, "
            f"got {path.gamma_max}"
        )
    for name in ("until", "save_at") if kinds else ():
        value = getattr(path, name)
        if value is not None:
            raise ValueError(f"{name} cannot be given together with {kinds[0]}, got {value!r}")


def _with_shapes(scene: Scene) -> Scene:
    """The scene with the ring at every state, and its softest modes."""
    return replace(scene, shapes=True, modes=True)


@dataclass(frozen=True)
class StatesOptions:
    """Which states, and what is written."""

    gamma: Annotated[
        float | None, number_option("Rotation of each grip, rad; the ring is free if not given.")
    ] = None
    count: Annotated[
        int,
        typer.Option(
            parser=whole,
            help="States after which to stop; minima that these fall to are added.",
        ),
    ] = 12
    edges: Annotated[int, typer.Option(parser=whole, help="Edges of the full ring.")] = 64
    json: Annotated[str | None, typer.Option(metavar="F", help="Write it here ('-': output).")] = (
        None
    )
    plot: Annotated[str | None, typer.Option(metavar="F", help="Draw it: .png, .pdf, .svg.")] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write states.json, .png and shapes.npz here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False


@command(app, RingOptions, StatesOptions)
def states(ring: RingOptions, wanted: StatesOptions) -> int:
    """Find the states of a ring, free or in its grips, and which of them falls to which."""
    from der.scene import Scene

    with options_named():
        whole = ring.ring()
        divisor, piece = (4, "a quarter") if whole.symmetry == "D2" else (2, "half")
        if wanted.edges % divisor:
            raise ValueError(
                f"edges must be divisible by {divisor}, as the path of twisting, where the search "
                f"starts, is followed on {piece} of the ring, got {wanted.edges}"
            )
        scene = Scene(whole, ring.section(), n_edges=wanted.edges, a_over_t=ring.a_over_t)
        written = targets(wanted.json, wanted.plot, None, wanted.out, stem="states")
        from der.analysis.multistability.states import states as search

        with counted("states", wanted.count, quiet=wanted.quiet) as tick:
            found = search(scene, gamma=wanted.gamma, count=wanted.count, progress=tick)
    from der.cli.drawings import of_states
    from der.records.states_text import words

    return hand_over(
        found,
        written,
        {"done": 0, "interrupted": 130}.get(found.status, 3),
        of_states(found),
        lambda: words(found),
        unfinished=f"{found.message}; states that were found: {len(found)},",
        quiet=wanted.quiet,
    )


@dataclass(frozen=True)
class PlanarOptions:
    """What is sought in the plane, and what is written."""

    distance: Annotated[
        float | None,
        number_option("Squeeze or pull the flat ring until the points of its axis are so far, a."),
    ] = None
    turns: Annotated[
        int | None, typer.Option(parser=whole, help="Cover circles up to so many times.")
    ] = None
    edges: Annotated[int, typer.Option(parser=whole, help="Edges of the full ring.")] = 256
    json: Annotated[str | None, typer.Option(metavar="F", help="Write it here ('-': output).")] = (
        None
    )
    plot: Annotated[str | None, typer.Option(metavar="F", help="Draw it: .png, .pdf, .svg.")] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write planar.json, .png and shapes.npz here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No summary.")] = False


@command(app, RingOptions, PlanarOptions)
def planar(ring: RingOptions, wanted: PlanarOptions) -> int:
    """Find the states of a ring in its plane, with its packing ratio; or squeeze it there."""
    from der.scene import Scene

    with options_named():
        if wanted.distance is not None and wanted.turns is not None:
            raise ValueError(f"turns cannot be given together with --distance, got {wanted.turns}")
        scene = Scene(ring.ring(), ring.section(), n_edges=wanted.edges, error_bars=True)
        written = targets(wanted.json, wanted.plot, None, wanted.out, stem="planar")
        found: Any
        if wanted.distance is None:
            from der.analysis.planar.planar_states import planar as search

            found = search(scene, turns=wanted.turns)
        else:
            from der.analysis.planar.squeeze import squeeze

            found = squeeze(scene, wanted.distance)
    from der.cli.drawings import of_planar
    from der.records.planar_text import words

    return hand_over(
        found,
        written,
        {"done": 0, "interrupted": 130}.get(found.status, 3),
        of_planar(found),
        lambda: words(found),
        unfinished=f"{found.message}; states that were found: {len(found)},",
        quiet=wanted.quiet,
    )


PHASES = {  # the diagrams of each shape, that of a cube last
    "ellipse": ("fig3a",),
    "rectangle": ("fig5b", "fig5c", "fig5a"),
    "triangle": ("fig8b", "fig8c", "fig8a"),
    "circle": ("circle",),
}


@app.command()
def phase(
    shape: Annotated[
        str,
        typer.Argument(
            metavar="SHAPE", help="ellipse, rectangle, triangle, circle; or a diagram: fig3a, ..."
        ),
    ],
    out: Annotated[str, typer.Option(metavar="DIR", help="The folder to write to.")],
    workers: Annotated[
        int | None, typer.Option(parser=whole, help="Processes; one a core if not given.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the cases that the folder has.")
    ] = False,
    nu: Annotated[float, number_option("Poisson's ratio.")] = NU,
    span: Annotated[
        list[str] | None,
        typer.Option("--range", metavar="NAME=A:B", help="Of a parameter, such as b_over_a=0.7:1."),
    ] = None,
    finest: Annotated[
        int | None, typer.Option(parser=whole, help="Finest cells along a side, a power of two.")
    ] = None,
    check: Annotated[
        str | None, typer.Option(help="'der': ask the rod about a sample of the cases.")
    ] = None,
    sample: Annotated[int, typer.Option(parser=whole, help="Cases that --check asks about.")] = 40,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="No progress and no summary; warnings.")
    ] = False,
) -> None:
    """Map how rings fold over profile and cross-section: cases, sharp boundaries, a picture."""
    with options_named():
        check_named(out=out)
        from der.analysis.fold import fold as rod
        from der.diagram.diagram import FAMILIES, run_phase

        chosen = PHASES.get(shape, (shape,) if shape in FAMILIES else ())
        if not chosen:
            words = ", ".join(dict.fromkeys([*PHASES, *FAMILIES]))
            raise typer.TyperException(f"SHAPE must be one of {words}, got {shape!r}")
        if check not in (None, "der"):
            raise ValueError(f"check must be 'der', got {check!r}")
        for name in chosen:
            text = run_phase(
                name,
                File(out) / name if len(chosen) > 1 else out,
                workers=workers,
                scheduler=scheduler,
                resume=resume,
                nu=nu,
                ranges=tuple(span or ()),
                check=rod if check else None,
                sample=sample,
                finest=finest,
                quiet=quiet,
                warn=lambda words: say(f"der: {words}"),
            )
            if not quiet:
                show(text)


@app.command()
def bench(
    json: Annotated[str | None, typer.Option(metavar="F", help="Write what is measured.")] = None,
    out: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Write bench.json, bench_error.png and bench_cost.png."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions and sizes.")] = False,
    only: Annotated[
        str | None,
        typer.Option(
            metavar="PARTS",
            help="Of paths, needs, orders, error, state, scaling, sweep, start; commas between.",
        ),
    ] = None,
) -> None:
    """Measure time, memory and error of this package and its peers, on this machine, in one run."""
    with options_named():
        check_named(json=json, out=out)
        if json is not None:
            check_writable("json", File(json))
        folder = (
            None if out is None else targets(None, None, None, out, stem="bench")["json"][0].parent
        )
        from validation.benchmark.run import PARTS, run

        parts = PARTS if only is None else tuple(part.strip() for part in only.split(","))
        run(None if json is None else File(json), out=folder, quick=quick, only=parts)


@app.command()
def stress(
    quick: Annotated[bool, typer.Option("--quick", help="120 cases, under a minute.")] = False,
    long: Annotated[
        bool, typer.Option("--long", help="10,000 cases, ten minutes on 2 cores.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(parser=whole, help="Processes; with --long one a core, else one.")
    ] = None,
    seed: Annotated[int, typer.Option(parser=whole, help="Of the cases.")] = 0,
    json: Annotated[str | None, typer.Option(metavar="F", help="Write the summary here.")] = None,
) -> None:
    """Try to break both solvers, and count what has no named reason."""
    with options_named():
        if quick and long:
            raise ValueError("quick cannot be given together with --long, got both")
        check_named(json=json)
        if json is not None:
            check_writable("json", File(json))
        from validation.stress.run import stress as run

        summary = run(
            "long" if long else "quick",
            None if json is None else File(json),
            seed=seed,
            workers=workers if workers is not None or long else 1,
        )
    show(str(summary))
    raise typer.Exit(130 if summary.interrupted else 0)
