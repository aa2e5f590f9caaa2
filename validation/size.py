"""The size of the code: lines, files, long functions, words, and modules that call each other.

    python -m validation.size [--tree DIR] [--pairs]

A line counts if it has a token that is neither a comment nor part of a docstring. The length of a
function is its number of lines, signature included, docstring apart. With ``--pairs``, `COMMAND`
runs twice in a child process, and cProfile watches the second run. A pair is a module of `der` with
a function that directly calls a function of another module of `der`.
"""

from __future__ import annotations

import ast
import io
import os
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path as File
from pstats import Stats
from typing import Any, NamedTuple

from scenarios.output import Arguments

FOLDERS = ("der", "validation", "scenarios", "tests")
LONG, WORST = 40, 10  # lines, above which a function is long; long functions that are named
COMMAND = "fold circle --h-over-t 4 --error-bars --plot p.png"
_PROFILED = """
import contextlib, cProfile, sys
from der.__main__ import main
for profile in (contextlib.nullcontext(), cProfile.Profile()):
    with profile, contextlib.suppress(SystemExit):
        main(sys.argv[1:])
profile.dump_stats("profile")
"""
_WITH_DOCSTRING = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


class Function(NamedTuple):
    """A function of the code, and how long it is."""

    place: str
    lines: int
    kernel: bool


def _docstring(node: ast.AST) -> range:
    """The lines of a node's docstring."""
    if isinstance(node, _WITH_DOCSTRING) and ast.get_docstring(node, clean=False) is not None:
        return range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
    return range(0)


def code_lines(source: str) -> int:
    """Lines of code, without docstrings, comments and blank lines."""
    lines = set[int]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.string.strip() and token.type != tokenize.COMMENT:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines.difference(*map(_docstring, ast.walk(ast.parse(source)))))


def functions(source: str, place: str) -> Iterator[Function]:
    """Every function of a source, those inside others too."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            lines = (node.end_lineno or 0) - node.lineno + 1 - len(_docstring(node))
            marks = [ast.unparse(one) for one in node.decorator_list]
            kernel = any("kernel" in one or "jit" in one for one in marks)
            yield Function(f"{place}:{node.lineno} {node.name}", lines, kernel)


def pairs(tree: File) -> tuple[int, int]:
    """Functions of `der` in the command, and pairs (caller's module, callee's module) of them."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", _PROFILED, *COMMAND.split()]
        env = os.environ | {"PYTHONPATH": str(tree)}
        subprocess.run(command, check=True, capture_output=True, cwd=folder, env=env)
        calls: dict[Any, Any] = Stats(str(File(folder, "profile"))).stats  # type: ignore[attr-defined]
    root = str(tree / "der") + os.sep
    known = {function for function in calls if function[0].startswith(root)}
    found = {(caller[0], callee[0]) for callee in known for caller in known & set(calls[callee][4])}
    return len(known), sum(caller != callee for caller, callee in found)


def report(tree: File) -> Iterator[str]:
    """The counts of a checkout, a line each."""
    files = {top: sorted((tree / top).rglob("*.py")) for top in FOLDERS}
    lines = {top: sum(code_lines(one.read_text()) for one in files[top]) for top in files}
    each = ", ".join(f"{top} {count}" for top, count in lines.items())
    yield f"{lines['der'] + lines['validation']:6d} lines of code: {each}"
    product = files["der"] + files["validation"]
    folder, most = Counter(one.parent for one in product).most_common(1)[0]
    yield f"{most:6d} files in the largest folder, {folder.relative_to(tree)}"
    found = [f for one in product for f in functions(one.read_text(), str(one.relative_to(tree)))]
    for name, kernels in (("functions", False), ("kernels", True)):
        kind = sorted((f for f in found if f.kernel is kernels), key=lambda f: -f.lines)
        long = [f for f in kind if f.lines > LONG]
        yield f"{len(long):6d} of {len(kind)} {name} over {LONG} lines, {len(long) / len(kind):.1%}"
        yield from (f"{'':8}{f.lines:4d} {f.place}" for f in long[:WORST])
    yield f"{len((tree / 'README.md').read_text().split()):6d} words in README.md"


def main() -> None:
    """Read the arguments and print."""
    parser = Arguments(__file__, __doc__)
    parser.add_argument("--tree", type=File, default=File(__file__).parents[1], metavar="DIR")
    parser.add_argument("--pairs", action="store_true", help=f"profile 'der {COMMAND}'")
    given = parser.parse_args()
    tree = given.tree.resolve()
    print(*report(tree), sep="\n", flush=True)
    if given.pairs:
        print("{1:6d} pairs of modules that call each other, {0} functions".format(*pairs(tree)))


if __name__ == "__main__":
    main()
