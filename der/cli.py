"""The command `der`: the roof over the packages, and the only file that imports typer.

Exit codes: 0 done; 2 bad input, in one line that names the option, the value and what is allowed;
3 not converged, with the last good state saved and named; 130 stopped by Ctrl-C, likewise saved.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path as File
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from der.record import Path
    from der.ring import Ring
    from der.scene import Scene
    from der.sections import Section

SHAPES = ("circle",)
NU = 0.3  # Poisson's ratio where none is given
UNSAVED = File("der-unfinished.json")  # where an unfinished path goes if no file was named
OUTPUT = File("-")  # standard output

app = typer.Typer(
    help="Discrete elastic rods for rings that fold by twisting.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave with its exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        code = app(args=arguments or ["--help"], prog_name="der", standalone_mode=False)
    except typer.TyperException as wrong:
        text = " ".join(str(getattr(wrong, "message", wrong)).split())
        if hasattr(wrong, "format_message"):
            text = " ".join(wrong.format_message().split())
        _say(f"der: {text}")
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except OSError as wrong:  # a full disk behind standard output, for one
        _say(f"der: {wrong}")
        code = 3
    sys.exit(code or 0)


def _number(text: str) -> float:
    """Parse an option's number, so that a bad one is named with its value."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, got {text!r}") from None


def _whole(text: str) -> int:
    """Parse an option's whole number, likewise."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"must be a whole number, got {text!r}") from None


def _say(line: str) -> None:
    print(line, file=sys.stderr)


def _show(text: str) -> bool:
    """Print on standard output; False, in words, where it takes no more."""
    try:
        print(text, flush=True)
    except OSError as wrong:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing more to flush
        if isinstance(wrong, BrokenPipeError):
            return True  # whoever read our output has had enough
        _say(f"der: could not write to standard output: {wrong.strerror}")
        return False
    return True


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


@contextmanager
def _options_named() -> Iterator[None]:
    """Turn a ValueError about an argument into one about the option of that name."""
    try:
        yield
    except ValueError as wrong:
        words = str(wrong).split(" ", 1)
        option = {"n_edges": "edges"}.get(words[0], words[0]).replace("_", "-")
        raise typer.TyperException(" ".join([f"--{option}", *words[1:]])) from None


@app.command()
def fold(
    shape: Annotated[str, typer.Argument(metavar="SHAPE", help="The ring: circle.")],
    h_over_t: Annotated[
        float | None, typer.Option(parser=_number, help="Height over thickness of the section.")
    ] = None,
    alpha: Annotated[
        float | None, typer.Option(parser=_number, help="EI1/GJ, with --beta.")
    ] = None,
    beta: Annotated[
        float | None, typer.Option(parser=_number, help="EI2/GJ, with --alpha.")
    ] = None,
    nu: Annotated[
        float, typer.Option(parser=_number, help="Poisson's ratio, with --h-over-t.")
    ] = NU,
    natural_curvature: Annotated[
        float,
        typer.Option(parser=_number, help="Natural curvature of the circle, in units of 1/a."),
    ] = 1.0,
    a_over_t: Annotated[
        float,
        typer.Option(
            parser=_number, help="Reference length over thickness: finite stretch and drawing."
        ),
    ] = 200.0,
    axis: Annotated[str, typer.Option(help="Twisting axis: x or y.")] = "x",
    edges: Annotated[int, typer.Option(parser=_whole, help="Edges of the full ring.")] = 64,
    gamma_max: Annotated[
        float, typer.Option(parser=_number, help="Where the path ends, rad.")
    ] = math.pi,
    until: Annotated[
        str | None, typer.Option(help="'folded': until the three-covered state, beyond pi too.")
    ] = None,
    save_at: Annotated[
        str | None, typer.Option(help="Solve at these gammas (rad, commas), not at k pi/8.")
    ] = None,
    curvature: Annotated[
        str, typer.Option(help="Measure of curvature: logarithm, angle or tangent.")
    ] = "logarithm",
    stretch: Annotated[str, typer.Option(help="inextensible or finite (EA).")] = "inextensible",
    tolerance: Annotated[
        float, typer.Option(parser=_number, help="Residual of an equilibrium, GJ/a.")
    ] = 1e-10,
    stability: Annotated[
        bool, typer.Option("--stability/--no-stability", help="Index of the full ring.")
    ] = True,
    control: Annotated[
        str, typer.Option(help="arclength (through folds), angle or moment (with snaps).")
    ] = "arclength",
    unload: Annotated[
        bool, typer.Option("--unload", help="Come back to 0, with --control angle.")
    ] = False,
    solver: Annotated[
        str, typer.Option(help="newton, or relaxation with --control angle.")
    ] = "newton",
    error_bars: Annotated[
        bool, typer.Option("--error-bars", help="Extrapolate from N, N/2, N/4 edges, with errors.")
    ] = False,
    sector: Annotated[str, typer.Option(help="auto, full, half or quarter.")] = "auto",
    json: Annotated[
        str | None, typer.Option(metavar="F", help="Write the record here ('-': output).")
    ] = None,
    plot: Annotated[
        str | None, typer.Option(metavar="F", help="Draw the path: .png, .pdf or .svg.")
    ] = None,
    rrd: Annotated[
        str | None, typer.Option(metavar="F", help="Record for playback with rerun: .rrd.")
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Write path.json, path.png and shapes.npz here."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False,
) -> None:
    """Fold a ring: the path of equilibria from flat on, its folds, and the index of every state."""
    from der.scene import Scene

    with _options_named():
        ring = _ring(shape, axis, natural_curvature)
        section = _section(h_over_t, alpha, beta, nu)
        scene = Scene(
            ring,
            section,
            n_edges=edges,
            sector=sector,
            stability=stability,
            error_bars=error_bars,
            control=control,
            unload=unload,
            solver=solver,
            shapes=any(file is not None for file in (plot, rrd, out)),
            gamma_max=gamma_max,
            until=until,
            save_at=_numbers("save_at", save_at),
            curvature=curvature,
            stretch=stretch,
            a_over_t=a_over_t,
            tolerance=tolerance,
        )
        targets = _targets(json, plot, rrd, out)
    raise typer.Exit(_fold(scene, targets, quiet=quiet))


def _ring(shape: str, axis: str, natural_curvature: float) -> Ring:
    """The ring that the command line describes."""
    from der.ring import circle

    if shape not in SHAPES:
        raise typer.TyperException(f"SHAPE must be {', '.join(SHAPES)}, got {shape!r}")
    if axis not in ("x", "y"):
        raise ValueError(f"axis must be x or y, got {axis!r}")
    return circle(natural_curvature)  # both axes of a circle are alike


def _section(h_over_t: float | None, alpha: float | None, beta: float | None, nu: float) -> Section:
    """The section that the command line describes."""
    from der.sections import rectangular_section, section

    if h_over_t is None and nu != NU:
        raise ValueError(f"nu can only be given together with --h-over-t, got {nu}")
    if h_over_t is not None:
        if alpha is not None or beta is not None:
            raise ValueError(
                f"h_over_t cannot be given together with --alpha and --beta, got {h_over_t}"
            )
        try:
            return rectangular_section(h_over_t, nu)
        except ValueError as wrong:
            if str(wrong).startswith(("alpha", "beta")):  # not what the user gave
                raise ValueError(f"h_over_t is too extreme: {wrong} for {h_over_t}") from None
            raise
    if alpha is None and beta is None:
        raise ValueError("h_over_t (or both --alpha and --beta) must be given, got neither")
    if alpha is None:
        raise ValueError(f"alpha must be given together with --beta {beta}, got none")
    if beta is None:
        raise ValueError(f"beta must be given together with --alpha {alpha}, got none")
    return section(alpha, beta)


def _numbers(name: str, text: str | None) -> tuple[float, ...] | None:
    """The numbers in a comma-separated list."""
    if text is None:
        return None
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name} must be numbers separated by commas, got {text!r}") from None


def _targets(
    json: str | None, plot: str | None, rrd: str | None, out: str | None
) -> dict[str, File]:
    """The files to write, after making sure that they can be written."""
    targets: dict[str, File] = {}
    if out is not None:
        folder = File(out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as wrong:
            raise ValueError(f"out must be a folder, got {out!r}: {wrong.strerror}") from None
        targets = {
            "json": folder / "path.json",
            "plot": folder / "path.png",
            "shapes": folder / "shapes.npz",
        }
    if json is not None:
        targets["json"] = File(json)
    if plot is not None:
        from der.view_plots import FORMATS

        if File(plot).suffix not in FORMATS:
            raise ValueError(f"plot must end in {', '.join(FORMATS)}, got {plot!r}")
        targets["plot"] = File(plot)
    if rrd is not None:
        if File(rrd).suffix != ".rrd":
            raise ValueError(f"rrd must end in .rrd, got {rrd!r}")
        targets["rrd"] = File(rrd)
    if targets.get("json") in [targets[name] for name in ("plot", "shapes") if name in targets]:
        raise ValueError(f"json must be a file of its own, got {json!r} twice")
    for name, file in targets.items():
        if file != OUTPUT:
            _check_writable(name if name != "shapes" else "out", file)
    return targets


def _check_writable(name: str, file: File) -> None:
    """Raise ValueError where ``file`` cannot be written, before hours are spent on it."""
    if file.is_dir():
        raise ValueError(f"{name} must be a file, got the folder {str(file)!r}")
    if file.exists() and not file.is_file():  # it would be replaced by a file: /dev/null!
        raise ValueError(f"{name} must be a regular file, got {str(file)!r}")
    try:
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as wrong:
        raise ValueError(
            f"{name} must be a file in a folder that can be written to, got {str(file)!r}: "
            f"{wrong.strerror}"
        ) from None


def _fold(scene: Scene, targets: dict[str, File], *, quiet: bool) -> int:
    """Follow the path, write what was asked for, and return the exit code."""
    from der.folding import Interrupted, NotConverged
    from der.folding import fold as run

    code = 0
    try:
        with _progress(scene, quiet=quiet) as tick:
            path = run(scene, progress=tick)
    except (NotConverged, Interrupted) as unfinished:
        path = unfinished.path
        code = 3 if isinstance(unfinished, NotConverged) else 130
        file = targets.setdefault("json", UNSAVED)
        targets.setdefault("shapes", (UNSAVED if file == OUTPUT else file).with_suffix(".npz"))
    if not _write(path, targets):
        code = code or 3
    if path.status != "done":
        _say(f"der: {path.message}; {_whereabouts(path, targets)}")
    if not quiet and targets.get("json") != OUTPUT:
        from der.summary import summary

        if not _show(summary(path)):
            code = code or 3
    return code


def _whereabouts(path: Path, targets: dict[str, File]) -> str:
    """Where an unfinished path went, and how far it got."""
    file = targets["json"]
    place = "on standard output" if file == OUTPUT else f"in {file}"
    if not len(path):
        return f"the record, without any state, is {place}"
    last = f"at gamma = {path.gamma[-1]:.8g}"
    return (
        f"the path up to its last good state, {last}, is {place}, its shapes in {targets['shapes']}"
    )


@contextmanager
def _progress(scene: Scene, *, quiet: bool) -> Iterator[Callable[[float], object] | None]:
    """A progress bar over gamma, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("loading kernels (compiled once, in half a minute)", total=None)
        states = 0

        def tick(gamma: float) -> None:
            nonlocal states
            states += 1
            text = f"gamma = {gamma:.3f}, {states} states"
            bar.update(task, completed=gamma, total=scene.gamma_max, description=text)

        yield tick


def _write(path: Path, targets: dict[str, File]) -> bool:
    """Write the record first, then what goes with it; say what could not be written.

    A record that cannot be written where it should goes to standard output, also in ``targets``:
    nothing already computed is lost.
    """
    done = True
    for name in ("json", "shapes", "plot", "rrd"):
        file = targets.get(name)
        if file is None:
            continue
        try:
            if name == "json" and file != OUTPUT:
                path.save(file)
            elif name == "shapes" and path.shapes is not None:
                path.shapes.save(file)
            elif name == "plot" and len(path) > 1:
                from der.view_plots import save_plot

                save_plot(path, file)
            elif name == "rrd" and len(path) > 1:
                from der.view_rerun import save_recording

                save_recording(path, file)
        except (OSError, ValueError) as wrong:
            done = False
            _say(f"der: could not write {file}: {wrong}")
            if name == "json":
                targets["json"] = OUTPUT
        if name == "json" and targets["json"] == OUTPUT:
            done = _show(path.to_json()) and done
    return done


@app.command()
def bench(
    json: Annotated[str | None, typer.Option(metavar="F", help="Write the rows here.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions and sizes.")] = False,
) -> None:
    """Measure CPU time, memory and error of paths and kernels, on this machine, in one run."""
    from validation.bench import run

    with _options_named():
        if json is not None:
            _check_writable("json", File(json))
    run(None if json is None else File(json), quick=quick)
