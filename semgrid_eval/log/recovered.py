"""What a log that was recovered from a damaged one says of that: a metadata record of its own."""

from collections.abc import Mapping
from dataclasses import dataclass

from semgrid_eval.words import plural

RECORD = "semgrid.recovery"
_UNKNOWN = "unknown"


@dataclass(frozen=True)
class Recovered:
    """How many messages were lost (None is not known), and what was kept although nothing proves that it is whole."""

    lost_messages: int | None = 0
    unproved: str = ""

    @classmethod
    def from_metadata(cls, entries: Mapping[str, str]) -> "Recovered":
        """Read the entries of the metadata record; what is no number is not known."""
        lost = entries.get("lost_messages", _UNKNOWN)
        return cls(int(lost) if lost.isdecimal() and len(lost) < 20 else None, entries.get("unproved", ""))

    def to_metadata(self) -> dict[str, str]:
        """Write the entries of the metadata record."""
        lost = _UNKNOWN if self.lost_messages is None else str(self.lost_messages)
        return {"lost_messages": lost, "unproved": self.unproved}

    def after(self, earlier: "Recovered") -> "Recovered":
        """Return what holds for a log that was recovered from one that had been recovered before."""
        known = self.lost_messages is not None and earlier.lost_messages is not None
        lost = (self.lost_messages or 0) + (earlier.lost_messages or 0) if known else None
        return Recovered(lost, ", ".join(filter(None, (earlier.unproved, self.unproved))))

    def __str__(self) -> str:
        count = self.lost_messages
        lost = "an unknown number of messages" if count is None else plural(count, "message")
        kept = f"; nothing proves that these are whole: {self.unproved}" if self.unproved else ""
        return f"was recovered from a damaged log, which lost {lost}{kept}"
