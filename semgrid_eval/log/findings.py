"""What a check finds in a log."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from semgrid_eval.errors import printable
from semgrid_eval.recording.types import Quantity

MOST_FINDINGS = 100
"""How many findings of one log are told, errors before warnings; the others are counted."""


class Severity(StrEnum):
    """An error makes a log unusable or its results wrong; a warning is worth a look."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd in a log; `place` is the topic or field."""

    severity: Severity
    place: str
    message: str

    def __str__(self) -> str:
        return printable(f"{self.severity}: {self.place}: {self.message}")


@dataclass(frozen=True)
class LogReport:
    """What a check found: message counts by topic, the time covered, and findings; a log is good without errors.

    `is_readable` says whether the log could be read to its end; where not, not everything was checked. `more` counts
    the findings beyond those that are told. `conditions` are what the log says of the recording's.
    """

    path: Path
    counts: dict[str, int]
    duration_s: float
    findings: tuple[Finding, ...]
    conditions: dict[str, Quantity]
    is_readable: bool = True
    more: int = 0

    @property
    def good(self) -> bool:
        """Whether there is no error."""
        return all(finding.severity is not Severity.ERROR for finding in self.findings)

    def to_json(self) -> dict[str, object]:
        """Return it as `check.schema.json` describes it."""
        return {
            "log": str(self.path),
            "good": self.good,
            "readable": self.is_readable,
            "duration_s": self.duration_s,
            "messages": self.counts,
            "conditions": {name: each._asdict() for name, each in self.conditions.items()},
            "findings": [
                {"severity": each.severity, "place": each.place, "message": each.message} for each in self.findings
            ],
            "more_findings": self.more,
        }


def bounded(findings: Iterable[Finding]) -> tuple[tuple[Finding, ...], int]:
    """Return as many findings as are told, in their order, and how many more there are; errors go first."""
    found = list(findings)
    kept = sorted(found, key=lambda each: each.severity is not Severity.ERROR)[:MOST_FINDINGS]
    told = found if len(found) <= MOST_FINDINGS else kept
    return tuple(told), len(found) - len(told)


def error(place: str, message: str) -> Finding:
    """Return an error."""
    return Finding(Severity.ERROR, place, message)
