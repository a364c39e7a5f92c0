"""Where a report's numbers come from: failures, logs, results, versions and the commands that made them."""

from collections.abc import Sequence
from dataclasses import dataclass

import yaml

from semgrid_eval.report.cells import Cell, Line, Table
from semgrid_eval.report.reading import Run


@dataclass(frozen=True)
class Failure:
    """Something that failed, and why."""

    kind: str
    name: str
    reason: str


@dataclass(frozen=True)
class Facts:
    """What a page says of how one run was made."""

    entries: tuple[tuple[str, str], ...]
    matrix: str


def failures(runs: Sequence[Run]) -> list[Failure]:
    """List the rows, results and logs that failed."""
    found = []
    for run in runs:
        found += [Failure("row", row.name, reason) for row in run.rows for reason in row.failures]
        found += [Failure("log", path, reason) for path, reason in sorted(run.record.failed_logs.items())]
    return found


def facts(run: Run) -> Facts:
    """List how a run was made."""
    record = run.record
    entries = [
        ("Title", record.title),
        ("Command", record.command),
        ("Started", record.started),
        ("Duration", duration(record.seconds)),
        *((f"Version of {name}", version) for name, version in sorted(record.versions.items())),
        *((f"Machine: {name}", value) for name, value in sorted(record.machine.items())),
    ]
    matrix = yaml.safe_dump(record.matrix, sort_keys=False, allow_unicode=True, width=100)
    return Facts(tuple(entries), matrix)


def log_table(runs: Sequence[Run]) -> Table:
    """List the logs by their paths, which example windows name, too, with their digests."""
    logs = {(log.path, log.digest): log for run in runs for log in run.record.logs}
    bodies = tuple((Line(log.path, (Cell(log.dataset), Cell(log.split), Cell(log.digest))),) for log in logs.values())
    columns = tuple((text, "") for text in ("Data set", "Split", "Digest"))
    return Table("logs", "Logs that took part, by their paths below the folder of logs", "Log", columns, bodies)


def result_table(runs: Sequence[Run]) -> Table:
    """List every result: its row, seed, id, windows and cost."""
    bodies = []
    for run in runs:
        for row in run.rows:
            for result in row.results:
                record = result.record
                cells = (
                    Cell("none" if record.seed is None else str(record.seed), record.seed),
                    Cell(record.id),
                    Cell(record.windows_id),
                    Cell(f"{len(record.windows):,}", len(record.windows)),
                    _seconds(record.train_seconds),
                    _seconds(record.predict_seconds),
                    Cell(record.device),
                )
                bodies.append((Line(row.name, cells, title=row.record.label),))
    names = ("Seed", "Result", "Window set", "Windows", "Training", "Prediction", "Device")
    return Table("results", "Results behind the rows", "Row", tuple((name, "") for name in names), tuple(bodies))


def duration(seconds: float) -> str:
    """Write a duration in hours, minutes and seconds."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole % 3600 // 60
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {whole % 60} s" if minutes else f"{seconds:.1f} s"


def _seconds(value: float | None) -> Cell:
    return Cell("none") if value is None else Cell(f"{value:.1f} s", value)
