"""What was saved of a damaged log, and what was not, for readers and as JSON."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from semgrid_eval.log.losses import Loss
from semgrid_eval.words import plural

MOST_LOSSES = 100
"""How many stretches are told of one by one."""


@dataclass(frozen=True)
class Recovery:
    """What was saved of a log, and what was not.

    `total` counts the messages that the log had by topic, None where its index is lost, too. `lost_files` are its
    attachments and metadata records that were lost; `unproved` is what was saved although nothing shows that it is
    whole. Of a log that is whole, a copy of its bytes is made.
    """

    path: Path
    out: Path
    is_whole: bool
    saved: Mapping[str, int]
    total: Mapping[str, int] | None = None
    losses: tuple[Loss, ...] = ()
    lost_files: tuple[str, ...] = ()
    unproved: tuple[str, ...] = ()

    @property
    def lost(self) -> dict[str, int] | None:
        """Messages that were lost by topic; None where it is not known how many."""
        if self.total is not None:
            missing = {topic: count - self.saved.get(topic, 0) for topic, count in self.total.items()}
            return {topic: count for topic, count in sorted(missing.items()) if count > 0}
        found: Counter[str] = Counter()
        for loss in self.losses:
            for each in loss.messages or ():
                found[each.topic] += each.count or 0
        known = all(loss.messages is not None and None not in [m.count for m in loss.messages] for loss in self.losses)
        return dict(sorted(found.items())) if known else None

    @property
    def lost_nothing(self) -> bool:
        """Whether all that the log held was saved, and proved."""
        return not (self.losses or self.lost or self.lost_files or self.unproved)

    def lines(self) -> Iterator[str]:
        """Say it in lines."""
        saved = sum(self.saved.values())
        if self.is_whole:
            yield f"is whole: {plural(saved, 'message')}, copied as they are to {self.out}"
            return
        of = "an unknown number of" if self.total is None else str(sum(self.total.values()))
        yield f"recovered {saved} of {of} messages to {self.out}"
        for loss in self.losses[:MOST_LOSSES]:
            yield f"lost: {loss}"
        if len(self.losses) > MOST_LOSSES:
            yield f"lost: {plural(len(self.losses) - MOST_LOSSES, 'more stretch', 'more stretches')}"
        yield from (f"lost: {name}" for name in self.lost_files)
        for topic, count in (self.lost or {}).items():
            total = f" of {self.total[topic]}" if self.total is not None else ""
            yield f"lost: {topic}: {count}{total} messages"
        if self.lost is None:
            yield "lost: how many messages is not known"
        yield from (f"kept, though nothing proves that it is whole: {what}" for what in self.unproved)

    def to_json(self) -> dict[str, object]:
        """Return it as `check.schema.json` describes it."""
        return {
            "out": str(self.out),
            "is_whole": self.is_whole,
            "saved": dict(self.saved),
            "total": None if self.total is None else dict(self.total),
            "lost": self.lost,
            "losses": [asdict(loss) for loss in self.losses[:MOST_LOSSES]],
            "more_losses": max(len(self.losses) - MOST_LOSSES, 0),
            "lost_files": list(self.lost_files),
            "unproved": list(self.unproved),
        }
