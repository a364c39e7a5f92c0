"""Where a report's numbers come from: failures, logs, results, versions, and commands to make and play them again."""

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import pandas as pd
import yaml

from semgrid_eval.files import digest_value
from semgrid_eval.report.claims.claims import scaling
from semgrid_eval.report.rows.load import Row, Run
from semgrid_eval.report.tables.table import Cell, Line, Table, plain_table
from semgrid_eval.scores.results import NOT_RUN, LogRecord, ResultRecord, RunRecord
from semgrid_eval.sources.benchmarks import FINGERPRINT_CHARACTERS, published_fingerprints
from semgrid_eval.words import plural


@dataclass(frozen=True)
class Failure:
    """Something that failed or is not whole, and why."""

    kind: str
    name: str
    reason: str


def failures(runs: Sequence[Run]) -> list[Failure]:
    """List the rows, results and logs that failed or are not whole."""
    found = []
    for run in runs:
        found += [Failure("row", row.name, reason) for row in run.rows for reason in row.failures]
        found += [Failure("skipped row", row.name, row.record.skipped) for row in run.rows if row.record.skipped]
        found += [Failure("log", log.path, log.recovered) for log in run.record.logs if log.recovered]
        found += [Failure("log", *reason) for reason in sorted(run.record.failed_logs.items())]
        tag = f" ({run.tag})" if run.tag else ""
        found += [Failure(fault.kind, f"{fault.name}{tag}", fault.reason) for fault in run.faults]
        found += [Failure("picture", *text.split(": ", 1)) for text in run.damaged_pictures]
    return found


def facts(run: Run, runs: Sequence[Run]) -> dict[str, Any]:
    """Return what the page says of how a run was made."""
    record = run.record
    entries = [
        ("Title", record.title),
        ("Command", record.command),
        ("Last start", record.started),
        ("Duration of the last start", duration(record.seconds)),
        *(("Data", text) for text in data_sets(record)),
        *((f"Version of {name}", version) for name, version in sorted(record.versions.items())),
        *((f"Machine: {name.replace('_', ' ')}", value) for name, value in sorted(record.machine.items())),
    ]
    matrix = {"matrix": matrix_text(run), "matrix_file": matrix_file(run, runs)}
    return {"entries": entries, "scaling": scaling(run), **matrix}


def data_sets(record: RunRecord) -> list[str]:
    """Name each data set of a run with its logs by split and a digest of them all, equal where all logs are.

    Of a published benchmark, say whether they are its logs.
    """
    names = sorted({log.dataset for log in record.logs})
    return [_data_set(name, [log for log in record.logs if log.dataset == name]) for name in names]


def _data_set(name: str, logs: Sequence[LogRecord]) -> str:
    digest = digest_value(sorted((log.split, log.name, log.digest) for log in logs))
    splits = Counter(log.split for log in logs)
    shares = " and ".join(f"{plural(count, 'log')} of {split}" for split, count in sorted(splits.items()))
    text = f"{name}: {shares}; digest {digest}"
    if unsummed := sum(not log.checksums for log in logs):
        text += f"; {unsummed} of {len(logs)} without checksums, so that damage to them cannot be seen"
    published = published_fingerprints(name)
    # A log to train on and to score is there twice.
    known = {log.digest: (log.fingerprint or "")[:FINGERPRINT_CHARACTERS] for log in logs}
    if not published or not any(known.values()):
        return text
    if others := sum(fingerprint not in published for fingerprint in known.values()):
        return f"{text}; {others} of {len(known)} are not as published"
    return f"{text}; {'all' if len(known) == len(published) else f'{len(known)} of {len(published):,}'}, as published"


def matrix_text(run: Run) -> str:
    """Write the run's matrix with every row complete, as `semgrid-eval run` reads it."""
    return yaml.safe_dump(run.record.matrix, sort_keys=False, allow_unicode=True, width=100)


def matrix_file(run: Run, runs: Sequence[Run]) -> str:
    """Name the file beside the page that holds the run's matrix."""
    return "matrix.yaml" if len(runs) == 1 else f"matrix-{1 + runs.index(run)}.yaml"


def command_table(runs: Sequence[Run]) -> Table:
    """Show what each row does and the command line that makes it again."""
    caption = (
        "The command that makes each row again. A run keeps the results that its --out folder already holds; "
        "name another folder to start over."
    )
    lines = []
    for run in runs:
        for row in run.rows:
            command = row_command(run.record.command, row.record.name, matrix_file(run, runs))
            cells = (Cell(row.record.label), Cell(_state(row)), Cell(command, tone="command"))
            lines.append(Line(row.name, cells, rows=(row.number,)))
    return plain_table("commands", caption, "Row", ("What it does", "Results", "Command"), lines)


def window_frame(runs: Sequence[Run]) -> pd.DataFrame:
    """Return one line for each window of each set of windows, with the times of its target and inputs."""
    results = (result.record for run in runs for row in run.rows for result in row.results)
    lines = [
        (name, w.recording, w.log, w.target_frame, w.target_stamp_ns, " ".join(map(str, w.input_stamps_ns)))
        for name, record in {record.windows_id: record for record in results}.items()
        for w in record.windows
    ]
    columns = ["window_set", "recording", "log", "target_frame", "target_stamp_ns", "input_stamps_ns"]
    return pd.DataFrame(lines, columns=columns)


def _state(row: Row) -> str:
    if row.is_left:
        return NOT_RUN
    if not row.results:
        return "skipped" if row.is_skipped else "failed"
    trained = row.results[0].record.seed is not None
    return plural(len(row.results), "seed") if trained else "no training"


def log_table(runs: Sequence[Run]) -> Table:
    """List the logs by their paths, which example windows name, too, with their digests."""
    logs = {(log.path, log.digest): log for run in runs for log in run.record.logs}
    lines = [
        Line(log.path, (Cell(log.dataset), Cell(log.split), Cell(log.digest), Cell("yes" if log.checksums else "none")))
        for log in logs.values()
    ]
    caption = "Logs that took part, by their paths below the folder of logs"
    return plain_table("logs", caption, "Log", ("Data set", "Split", "Digest", "Checksums"), lines)


def result_table(runs: Sequence[Run]) -> Table:
    """List every result: its row, seed, id, windows and cost."""
    rows = [row for run in runs for row in run.rows]
    lines = [
        Line(row.name, _result(each.record), "", row.record.label, (row.number,))
        for row in rows
        for each in row.results
    ]
    names = ("Seed", "Result", "Window set", "Windows", "Training", "Prediction", "Device")
    return plain_table("results", "Results behind the rows", "Row", names, lines)


def _result(record: ResultRecord) -> tuple[Cell, ...]:
    return (
        Cell("none" if record.seed is None else str(record.seed), record.seed),
        Cell(record.id),
        Cell(record.windows_id),
        Cell(f"{len(record.windows):,}", len(record.windows)),
        _seconds(record.train_seconds),
        _seconds(record.predict_seconds),
        Cell(record.device),
    )


def duration(seconds: float) -> str:
    """Write a duration in hours, minutes and seconds."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole % 3600 // 60
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {whole % 60} s" if minutes else f"{seconds:.1f} s"


def _seconds(value: float | None) -> Cell:
    return Cell("none") if value is None else Cell(f"{value:.1f} s", value)


def row_command(command: str, row: str, matrix: str) -> str:
    """Return the command line that makes one row: the run's own, narrowed to it, or one that reads the matrix file."""
    words = _words(command) or ["semgrid-eval", "run", matrix, "--logs", "LOGS", "--out", "RUN"]
    kept, skip = [], False
    for word in words:
        if not skip and word != "--row" and not word.startswith("--row="):
            kept.append(word)
        skip = not skip and word == "--row"
    return shlex.join([*kept, "--row", row])


def play_command(command: str, row: str, recording: str) -> str:
    """Return the command line that plays a recording of a row, with the folders that the run's own names.

    Args:
        command: of the run.
        row: its name.
        recording: its name.
    """
    spread = [part for word in _words(command) for part in (word.split("=", 1) if word.startswith("--") else [word])]
    found = {name: value for name, value in pairwise(spread) if name.startswith("--")}
    logs = found.get("--validation-logs", found.get("--logs", "LOGS"))
    where = [found.get("--out", "RUN"), row, "--logs", logs]
    return shlex.join(["semgrid-eval", "play", *where, "--recording", recording, "--out", "play.mcap"])


def _words(command: str) -> list[str]:
    """Split a run's command line as a shell does; empty where it is none."""
    try:
        words = shlex.split(command)
    except ValueError:  # it was not written by a shell's rules
        return []
    return words if words[:2] == ["semgrid-eval", "run"] else []
