"""Rings of the user's own shape from files: CSV with one line of names, or JSON."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from der.geometry.ring import Ring
from der.geometry.shapes import profile

COLUMNS = {
    ("arc_length", "curvature"): "knots of the natural curvature",
    ("x", "y"): "points of the curve",
}


def read_profile(file: str) -> Ring:
    """The ring of a file.

    Parameters
    ----------
    file : a CSV file whose first line names its two columns, arc_length,curvature or x,y; or JSON,
        an object with "arc_length" and "curvature", or with "points", a list of pairs. Lines of a
        CSV file that start with # are not read. What they mean, `shapes.profile` says.

    Raises
    ------
    ValueError
        Where the file cannot be read, is of another form, or not a ring; named by ``file``.
    """
    try:
        text = Path(file).read_text(encoding="utf-8")
        entries = _of_json(text) if Path(file).suffix == ".json" else _of_csv(text)
        return profile(**entries)  # type: ignore[arg-type]
    except OSError as wrong:
        raise ValueError(f"file must be readable, got {file!r}: {wrong.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"file must be a text file, got {file!r}") from None
    except (ValueError, TypeError, csv.Error) as wrong:
        raise ValueError(f"file {file!r}: {wrong}") from None


def _of_json(text: str) -> dict[str, object]:
    entries = json.loads(text)
    if not isinstance(entries, dict) or set(entries) not in (
        {"arc_length", "curvature"},
        {"points"},
    ):
        raise ValueError("must be an object with arc_length and curvature, or with points")
    return entries


def _of_csv(text: str) -> dict[str, object]:
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    names, *rows = [[entry.strip() for entry in row] for row in csv.reader(lines)] or [[]]
    if tuple(names) not in COLUMNS:
        allowed = " or ".join(",".join(columns) for columns in COLUMNS)
        raise ValueError(f"its first line must be {allowed}, got {','.join(names)!r}")
    values: list[list[float]] = []
    for number, row in enumerate(rows, start=1):
        try:
            first, second = (float(entry) for entry in row)
        except ValueError:
            raise ValueError(f"row {number} must be two numbers, got {','.join(row)!r}") from None
        values.append([first, second])
    if names[0] == "x":
        return {"points": values}
    return {"arc_length": [s for s, _ in values], "curvature": [k for _, k in values]}
