"""Arguments of what is run by `python -m`: a usage, and one line for what is not known."""

from __future__ import annotations

import argparse
from pathlib import Path as File
from typing import NoReturn


class Arguments(argparse.ArgumentParser):
    """The parser of one module: its docstring is the help, an error is a line and exit code 2.

    Parameters
    ----------
    file : the module's `__file__`.
    text : its docstring.
    """

    def __init__(self, file: str, text: str | None) -> None:
        place = File(file).resolve().relative_to(File(__file__).resolve().parents[1])
        super().__init__(
            prog=f"python -m {'.'.join(place.with_suffix('').parts)}",
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    def error(self, message: str) -> NoReturn:
        """Leave with one line."""
        self.exit(2, f"{self.prog}: {message}\n")
