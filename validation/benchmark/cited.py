"""Times of other codes, measured elsewhere; printed after the benchmark in a table of their own."""

from __future__ import annotations

CITED = {
    "source": "measured once for this project on one core of a like machine, not by this command",
    "figures": [
        {"code": "AUTO-07p", "ring": "circle, h/t 4, 0 to pi", "error": 4e-5, "ms": 26},
        {"code": "AUTO-07p", "ring": "circle, h/t 4, 0 to pi", "error": 7e-7, "ms": 47},
        {"code": "AUTO-07p", "ring": "rectangle, 0 to pi", "error": None, "ms": 304},
        {"code": "ElasticRods, C++", "ring": "circle, h/t 4, 0 to pi", "error": 2.3e-3, "ms": 633},
    ],
}


def cited() -> str:
    """The table of these times."""
    lines = [f"\ncited, {CITED['source']}:"]
    figures: list[dict[str, object]] = CITED["figures"]  # type: ignore[assignment]
    for figure in figures:
        error = "" if figure["error"] is None else f"error {figure['error']:.1e}"
        lines.append(f"  {figure['code']:18}{figure['ring']:26}{figure['ms']:>6} ms  {error}")
    return "\n".join(lines)
