"""The results of a stress run: counted, printed and saved."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from der.utils.files import Saved
from validation.stress.cases import Case


@dataclass(frozen=True)
class Failure:
    """A case that failed."""

    case: Case
    reason: str  # failures are counted by it: a refusal, the reason of a solver, or a fault
    message: str
    explained: bool
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """The entries of its JSON object, from which the case can be repeated."""
        return asdict(self) | {"case": self.case.to_json()}


@dataclass
class Summary(Saved):
    """The results of all cases."""

    level: str
    seed: int
    cases: int = 0
    failures: int = 0  # cases with at least one
    unexplained: int = 0  # of these
    by_reason: dict[str, int] = field(default_factory=dict)  # cases, by their first reason
    by_kind: dict[str, int] = field(default_factory=dict)  # cases tried
    seconds: float = 0.0
    slowest: float = 0.0
    interrupted: bool = False
    failed: list[Failure] = field(default_factory=list)

    def to_json(self) -> str:
        """JSON: numbers, reasons, and every failure with its case."""
        entries = asdict(self) | {"failed": [failure.to_json() for failure in self.failed]}
        return json.dumps(entries, indent=1, allow_nan=False) + "\n"

    def __str__(self) -> str:
        """A table of reasons, worst first."""
        lines = [
            f"{self.cases} cases in {self.seconds:.0f} s, {self.failures} failures, "
            f"{self.unexplained} unexplained" + (", interrupted" if self.interrupted else "")
        ]
        examples = {failure.reason: failure for failure in reversed(self.failed)}
        for reason, count in sorted(self.by_reason.items(), key=lambda item: -item[1]):
            mark = "" if examples[reason].explained else "UNEXPLAINED "
            lines.append(f"{count:6d}  {mark}{reason}, first: {examples[reason].message}"[:160])
        return "\n".join(lines)

    def add(self, case: Case, found: Sequence[Failure], seconds: float) -> None:
        """Count a case and its failures."""
        self.cases += 1
        self.by_kind[case.kind] = self.by_kind.get(case.kind, 0) + 1
        self.slowest = max(self.slowest, seconds)
        if not found:
            return
        worst = next((failure for failure in found if not failure.explained), found[0])
        self.failed.append(worst)
        self.failures += 1
        self.unexplained += not worst.explained
        self.by_reason[worst.reason] = self.by_reason.get(worst.reason, 0) + 1
