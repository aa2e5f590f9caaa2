"""`validation.size`: what counts as a line of code, and how long a function is."""

from __future__ import annotations

from pathlib import Path

from validation.size import code_lines, functions, report

SOURCE = '''"""Module.

Two lines."""

import math  # counted, once


def area(
    r,  # a comment
):
    """One line."""
    # no code
    text = """a text
that is no docstring"""

    @kernel
    def kernel(): return 0

    return math.pi * r**2, text
'''


def test_docstrings_comments_and_blank_lines_are_not_code() -> None:
    """Counted by hand; a string that is no docstring is code on all its lines."""
    assert code_lines(SOURCE) == 9


def test_functions_are_measured_without_their_docstring_and_kernels_are_known() -> None:
    """From the line of ``def`` to the last one, blank lines and comments included."""
    found = {f.place.split()[-1]: (f.lines, f.kernel) for f in functions(SOURCE, "m.py")}
    assert found == {"area": (11, False), "kernel": (1, True)}


def test_the_report_counts_a_checkout(tmp_path: Path) -> None:
    """On a tree of one file in each folder."""
    for top in ("der", "validation", "scenarios", "tests"):
        (tmp_path / top).mkdir()
        (tmp_path / top / "one.py").write_text(SOURCE)
    (tmp_path / "README.md").write_text("three plain words\n")
    lines = list(report(tmp_path))
    assert lines[0].split()[0] == "18"
    assert lines[-1].split()[0] == "3"
