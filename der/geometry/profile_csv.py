"""Rings of the user's own shape from files: tables of two or three columns, or JSON."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from der.geometry.scale import LENGTHS, number_and_unit
from der.geometry.shapes import DATA, profile
from der.geometry.table import read_table
from der.utils.checks import shown
from der.utils.files import content

if TYPE_CHECKING:
    from der.geometry.ring import Ring
    from der.geometry.table import Table

ARC_LENGTH = ("arc_length", "arclength", "arc", "s")
CURVATURE = ("curvature", "kappa", "k", "k1u")
PLACES = (
    ("x", "y", "z"),
    ("r1", "r2", "r3"),
    ("x1", "x2", "x3"),
    ("x", "y"),
    ("r2", "r3"),
    ("r1", "r2"),
    ("x1", "x2"),
    ("x", "z"),
    ("y", "z"),
)  # names of the coordinates of points
LARGEST = 2**27  # bytes: three million points
MOST = 6_000_000  # lines and commas of a file: twice a million points
ALIKE = 3.0  # a over half the larger extent, or the inverse


def read_profile(file: str, twist_axis: str | None = None, size: str | None = None) -> Ring:
    """Return the ring of a file, in units of half its larger extent or of a size that is given.

    Parameters
    ----------
    file : str
        A table: columns separated by commas, semicolons, tabs or spaces; decimal points, or decimal
        commas where columns are separated otherwise. Lines that are empty or start with # are not
        read. Names of columns, with or without units, stand in a line before the numbers: x, y or
        x, y, z for points of the curve, arc_length, curvature for its natural curvature. Numbers
        without names are points. Or JSON: an object with "points", a list of pairs, or with
        "arc_length" and "curvature".
    twist_axis : str, optional
        Of several mirror axes "x", the shortest, or "y", the longest: see `shapes.profile`.
    size : str, optional
        The reference length a, with its unit. The lengths of the file are then in this unit, 100 in
        the file being "100 mm", or in units of a, 1 in the file being "100 mm": whichever makes a
        like half the larger extent.

    Raises
    ------
    ValueError
        Where the file cannot be read, is of another form, or not a ring; named by ``file``.
    """
    path, first = Path(file), ""
    try:
        text = _decoded(content(path, LARGEST))
    except OSError as wrong:
        raise ValueError(f"file must be readable, got {file!r}: {wrong.strerror}") from None
    except ValueError as wrong:
        raise ValueError(f"file {wrong}, got {file!r}") from None
    try:
        if path.suffix == ".json":
            given = _of_json(text)
        else:
            table = read_table(text)
            first = f" (numbers from line {table.line} on)"
            given = _columns(table)
        ring = profile(**given, twist_axis=twist_axis, resized=True)  # type: ignore[arg-type]
        return ring if size is None else _sized(ring, size)
    except (ValueError, TypeError, RecursionError) as wrong:
        if str(wrong).startswith(("twist_axis", "size")):
            raise
        raise ValueError(f"file {file!r}{first}: {wrong}") from None


def _sized(ring: Ring, size: str) -> Ring:
    """Return a ring in units of the size that the user gives, instead of half its extent."""
    number, unit = number_and_unit("size", size, LENGTHS, "100mm")
    data = {name: ring.parameters[name] for name in DATA if name in ring.parameters}
    extent = data.get("reference_length", 1.0)
    fits = [a for a in dict.fromkeys((number, 1.0)) if 1.0 / ALIKE < extent / a < ALIKE]
    if len(fits) != 1:
        why = "neither is" if not fits else "both are, so give it in another unit"
        raise ValueError(
            f"size must be like half the larger extent of the profile, {extent:.6g}, in the unit "
            f"of --size ({unit}) or with 1 for a: {why}, got {size!r}"
        )
    (a,) = fits
    s, k = (np.array(ring.parameters[name]) for name in ("arc_length", "curvature"))
    same = profile(s * (extent / a), k / (extent / a))
    return replace(same, parameters={**same.parameters, **data, "reference_length": a})


def _decoded(read: bytes) -> str:
    """Return the text of a file, which must be one of no more numbers than can be many points."""
    encodings = ["utf-16"] if read[:2] in (b"\xff\xfe", b"\xfe\xff") else ["utf-8-sig", "cp1252"]
    for encoding in encodings:
        with suppress(UnicodeDecodeError):
            text = read.decode(encoding)
            break
    else:
        text = "\0"
    if "\0" in text:
        raise ValueError("must be a text file")
    marks = text.count(",") + max(text.count("\n"), text.count("\r"))
    if marks > MOST:
        raise ValueError(f"must have at most {MOST} lines and commas")
    return text


def _of_json(text: str) -> dict[str, object]:
    entries = json.loads(text)
    if not isinstance(entries, dict) or set(entries) not in (
        {"arc_length", "curvature"},
        {"points"},
    ):
        raise ValueError("must be an object with arc_length and curvature, or with points")
    return entries


def _columns(table: Table) -> dict[str, object]:
    """Return the arguments of `profile` that the columns are, by their names."""
    place = {word: i for i, words in reversed(list(enumerate(table.names))) for word in words}
    for arc_length, curvature in product(ARC_LENGTH, CURVATURE):
        if arc_length in place and curvature in place:
            columns = table.values[:, [place[arc_length], place[curvature]]].T
            return {"arc_length": columns[0], "curvature": columns[1]}
    for known in PLACES:
        if all(word in place for word in known):
            return {"points": table.values[:, [place[word] for word in known]]}
    if table.names and not table.is_comment:
        raise ValueError(
            f"its columns must be named x,y (or x,y,z) for points, or arc_length,curvature, "
            f"got {shown(table.header)}"
        )
    if table.values.shape[1] not in (2, 3):
        raise ValueError(
            f"must have two or three columns, or a line that names them, got "
            f"{table.values.shape[1]} in line {table.line}; numbers with decimal commas must be "
            "separated by semicolons, tabs or spaces"
        )
    return {"points": table.values}
