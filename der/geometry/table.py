"""Tables of numbers as strangers write them: what separates columns, decimal commas, names."""

import re
from dataclasses import dataclass

import numpy as np

from der.geometry.outline import Array
from der.utils.checks import shown

COMMENTS = ("#", "%", "//", "!")
PREAMBLE = 100  # lines among which the first numbers are
LONGEST = 10_000  # characters of the first line of numbers
UNIT = re.compile(r"\[[^]]*\]|\([^)]*\)")  # in a head: [mm], (mm)
DECIMAL_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")


@dataclass(frozen=True)
class Table:
    """Numbers in columns.

    Attributes
    ----------
    values : ndarray, shape (n, m)
    names : for each column the words of its head in lower case, without a unit; empty: no heads
    header : the heads as they stand in the file
    is_comment : whether the heads stand in a comment, and may be something else
    line : number of the first line of numbers, from 1
    """

    values: Array
    names: tuple[frozenset[str], ...]
    header: str
    is_comment: bool
    line: int


def read_table(text: str) -> Table:
    """Return the numbers of a text and the names of their columns.

    Raises
    ------
    ValueError
        Naming the line that is not like the others.
    """
    lines = text.replace('"', "").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept = [i for i, line in enumerate(lines) if line.strip()]
    numbered = [i for i in kept if not lines[i].lstrip().startswith(COMMENTS)]
    begin = next((i for i in numbered[:PREAMBLE] if _width(lines[i]) > 1), None)
    if begin is None:
        seen = shown(lines[numbered[0]]) if numbered else "none"
        raise ValueError(f"must have lines of numbers, such as 1.5,2.5, got {seen}")
    separator, width = _separator(lines[begin]), _width(lines[begin])
    rows = numbered[numbered.index(begin) :]
    values = _values([lines[i] for i in rows], separator)
    if values is None or values.shape[1] != width or not np.isfinite(values).all():
        i = next((i for i in rows if not _are_numbers(lines[i], separator, width)), begin)
        raise ValueError(
            f"line {i + 1} must be {width} finite numbers as line {begin + 1} is, "
            f"got {shown(lines[i].strip())}"
        )
    above = kept[kept.index(begin) - 1] if kept[0] < begin else None
    header = "" if above is None else lines[above].strip()
    is_comment = header.startswith(COMMENTS)
    names = _names(header.lstrip("#%/! "), separator, width)
    if header and not is_comment and not names:
        raise ValueError(
            f"line {begin} must name the {width} columns below it, got {shown(header)}"
        )
    return Table(values, names, header, is_comment, begin + 1)


def _separator(line: str) -> str | None:
    """Return what separates the columns; None: spaces."""
    for mark in (";", "\t"):
        if mark in line:
            return mark
    words = line.split()
    has_commas = len(words) > 1 and all(DECIMAL_COMMA.fullmatch(word) for word in words)
    return None if has_commas or "," not in line else ","


def _entries(line: str, separator: str | None) -> list[str]:
    """Return what stands in the columns of a line, without empty ones at its end."""
    words = line.split("#")[0].strip().rstrip(separator).split(separator)
    return [word.strip() for word in words]


def _numbers(line: str, separator: str | None) -> list[float] | None:
    """Return the numbers of a line, None if there are others."""
    try:
        return [float(word) for word in _entries(_pointed(line, separator), separator)]
    except ValueError:
        return None


def _pointed(line: str, separator: str | None) -> str:
    """Return a line with decimal points, where commas do not separate columns."""
    return line if separator == "," else line.replace(",", ".")


def _width(line: str) -> int:
    """Return how many numbers a line has, 0 if there is anything else in it or it has no end."""
    return len(_numbers(line, _separator(line)) or []) if len(line) <= LONGEST else 0


def _are_numbers(line: str, separator: str | None, width: int) -> bool:
    numbers = _numbers(line, separator)
    return numbers is not None and len(numbers) == width and bool(np.isfinite(numbers).all())


def _values(lines: list[str], separator: str | None) -> Array | None:
    """Return the numbers of all lines, None where they are not a table."""
    ends = lines[0].rstrip(" ").endswith(separator or " ")
    rows = (
        _pointed(line.rstrip(" ").rstrip(separator) if ends else line, separator) for line in lines
    )
    try:
        return np.loadtxt(rows, delimiter=separator, ndmin=2)
    except ValueError:
        return None


def _names(header: str, separator: str | None, width: int) -> tuple[frozenset[str], ...]:
    """Return the words of each column's head; none where there are not as many heads."""
    plain = UNIT.sub("", header).lower()
    for mark in (separator, ";", "\t", ",", None):
        heads = _entries(plain, mark)
        if len(heads) == width:
            return tuple(frozenset([head, *re.split(r"[\s/_:.-]+", head)]) for head in heads)
    return ()
