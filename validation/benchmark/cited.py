"""Times of other codes, measured elsewhere; printed after the benchmark in a table of their own."""

from __future__ import annotations

CITED = {
    "source": "measured once for this project on one core of a like machine, not by this command",
    "settings": "AUTO-07p: -O3, analytic Jacobians, DSMAX = 2, no user points",
    "figures": [
        {"code": "AUTO-07p, tuned", "ring": "circle, h/t 4, 0 to pi", "error": 4e-7, "ms": 16.2},
        {"code": "AUTO-07p, tuned", "ring": "rectangle, 0 to pi", "error": 1e-7, "ms": 74},
        {"code": "ElasticRods, C++", "ring": "circle, h/t 4, 0 to pi", "error": 2.3e-3, "ms": 633},
    ],
}


def cited() -> str:
    """The table of these times."""
    lines = [f"\ncited, {CITED['source']} ({CITED['settings']}):"]
    figures: list[dict[str, object]] = CITED["figures"]  # type: ignore[assignment]
    for figure in figures:
        error = "" if figure["error"] is None else f"error {figure['error']:.1e}"
        lines.append(f"  {figure['code']:18}{figure['ring']:26}{figure['ms']:>6} ms  {error}")
    return "\n".join(lines)
