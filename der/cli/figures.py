"""Commands that draw what the paper shows: `figure`, and `phase` for phase diagrams."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from pathlib import Path as File
from typing import TYPE_CHECKING

import typer

import der
from der.cli.files import check_named
from der.cli.options import NU
from der.cli.output import say, show
from der.cli.parsing import argument, folder_option, option, options_named

if TYPE_CHECKING:
    from der.paper import Interrupted

PHASES = {  # the diagrams of each shape, that of a cube last
    "ellipse": ("fig3a",),
    "rectangle": ("fig5b", "fig5c", "fig5a"),
    "triangle": ("fig8b", "fig8c", "fig8a"),
    "circle": ("circle",),
}


@dataclass(frozen=True)
class FigureOptions:
    """Which figures, and where they go."""

    names: list[str] = argument("fig2b, fig3b, ..., hysteresis; all; or diagrams.", "NAME...")
    out: str = folder_option("The folder to write to.", MISSING)
    workers: int | None = option("Processes; one a core if not given.")


def figure(wanted: FigureOptions) -> int:
    """Draw the paper's figures: PNG, and the data as CSV. Diagrams are the phase diagrams."""
    with options_named():
        check_named(out=wanted.out)
        from der.paper import DIAGRAMS, FIGURES, Interrupted, draw

        several = {"all": list(FIGURES), "diagrams": list(DIAGRAMS)}
        names = several.get(" ".join(wanted.names), wanted.names)
        try:
            drawn = draw(names, wanted.out, workers=wanted.workers, warn=_warn)
        except Interrupted as stopped:
            drawn, code = stopped.drawn, 130
            say(_stopped(names, stopped))
        else:
            code = 3 if drawn.failed else 0
    for files in drawn.written.values():
        for file in files:
            show(str(file))
    for name, reason in drawn.failed.items():
        say(f"der: {name} failed: {reason}")
    return code


def _stopped(names: list[str], stopped: Interrupted) -> str:
    """What was drawn before Ctrl-C, and what was not."""
    done = [name for name in names if name in stopped.drawn.written]
    left = [name for name in names if name not in {*done, *stopped.drawn.failed}]
    kept = f"; {stopped}" if str(stopped) else ""
    drawn = f"drawn: {', '.join(done) or 'none'}; not drawn: {', '.join(left) or 'none'}"
    return f"der: stopped by the user; {drawn}{kept}"


@dataclass(frozen=True)
class PhaseOptions:
    """Which diagrams, of which cases, and where they go."""

    shape: str = argument("ellipse, rectangle, triangle, circle; or a diagram: fig3a, ...", "SHAPE")
    out: str = folder_option("The folder to write to.", MISSING)
    workers: int | None = option("Processes; one a core if not given.")
    scheduler: str | None = option("A Dask scheduler, instead.", metavar="ADDRESS")
    resume: bool = option("Go on with the cases that the folder has.", False)
    nu: float = option("Poisson's ratio.", NU)
    span: list[str] | None = option(
        "Of a parameter, such as b_over_a=0.7:1.", metavar="NAME=A:B", name="--range"
    )
    finest: int | None = option("Finest cells along a side, a power of two.")
    check: str | None = option("'der': ask the rod about a sample of the cases.")
    sample: int = option("Cases that --check asks about.", 40)
    quiet: bool = option("No progress and no summary; warnings.", False)


def phase(wanted: PhaseOptions) -> int:
    """Map how rings fold over profile and cross-section: cases, sharp boundaries, a picture."""
    with options_named():
        check_named(out=wanted.out)
        from der.diagram.diagram import FAMILIES

        shape = wanted.shape
        chosen = PHASES.get(shape, (shape,) if shape in FAMILIES else ())
        if not chosen:
            words = ", ".join(dict.fromkeys([*PHASES, *FAMILIES]))
            raise typer.TyperException(f"SHAPE must be one of {words}, got {shape!r}")
        if wanted.check not in (None, "der"):
            raise ValueError(f"check must be 'der', got {wanted.check!r}")
        for name in chosen:
            text = _diagram(wanted, name, File(wanted.out) / (name if len(chosen) > 1 else ""))
            if not wanted.quiet:
                show(text)
    return 0


def _diagram(wanted: PhaseOptions, name: str, folder: File) -> str:
    """Make one diagram, say what its boundaries leave open, and return its summary."""
    from der.diagram.diagram import doubts, phase_diagram, summary

    same = ("workers", "scheduler", "resume", "nu", "sample", "finest")
    diagram = phase_diagram(
        name,
        folder,
        ranges=dict(map(_range, wanted.span or ())),
        check=der.fold if wanted.check else None,
        progress=not wanted.quiet,
        **{option: getattr(wanted, option) for option in same},
    )
    for words in doubts(diagram):
        say(f"der: {name}: {words}")
    return summary(diagram)


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """The name and the two numbers of "b_over_a=0.7:1"."""
    name, _, values = text.partition("=")
    try:
        low, high = map(float, values.split(":"))
    except ValueError:
        raise ValueError(f"ranges must be like b_over_a=0.7:1, got {text!r}") from None
    return name.strip().replace("-", "_"), (low, high)


def _warn(words: str) -> None:
    say(f"der: {words}")
