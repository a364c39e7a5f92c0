"""What became of a conversion, as commands that write logs say it."""

from pathlib import Path
from typing import TYPE_CHECKING

from semgrid_eval.cli.console import complain, say
from semgrid_eval.errors import InputError
from semgrid_eval.words import plural

if TYPE_CHECKING:
    from semgrid_eval.log.convert import ConversionSummary


def show(summary: "ConversionSummary", out: Path) -> int:
    """Print what became of a conversion, and return the exit code."""
    for label, reason in summary.failed.items():
        complain(f"Error: {label}: {reason}")
    say(f"{out}: {len(summary.written)} written, {len(summary.skipped)} up to date, {len(summary.failed)} failed")
    others = _strays(out, summary)
    if others:
        complain(
            f"Warning: {out} holds {plural(len(others), 'log')} beside those of this conversion, such as {others[0]}"
        )
    if summary.written or summary.skipped:  # what is said is about logs that there are
        if summary.warning:
            complain(f"Warning: {summary.warning}")
        if summary.remark:
            say(summary.remark)
    return 1 if summary.failed else 0


def _strays(out: Path, summary: "ConversionSummary") -> list[Path]:
    """Return the logs that a conversion neither wrote nor found there.

    Unless it is for all splits, those of other splits do not count: each may be converted by a command of its own.
    """
    from semgrid_eval.log.store import find_logs, label_of

    splits = {label.split("/")[0] for label in summary.labels}
    try:
        logs = find_logs(out)
    except InputError:  # every recording failed
        return []
    others = {label_of(log, out): log for log in logs if label_of(log, out) not in summary.labels}
    return [log for label, log in others.items() if summary.all_splits or label.split("/")[0] in splits]
