"""The record of a run: what was asked, on which machine with which versions, and what became of each row."""

import datetime
import os
import platform
import subprocess
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import torch

import semgrid_eval
from semgrid_eval.packages import installed_versions
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row, units_of
from semgrid_eval.runs.worker import Worker
from semgrid_eval.scores import results

_NEEDED = ["torch", "numpy", "numba", "opencv-python-headless", "mcap", "protobuf", "pandas", "eclipse-sumo", "embreex"]


class Outcome(NamedTuple):
    """What became of a unit: the id of its result, or the reason why there is none."""

    result_id: str | None
    failure: str | None
    left_out: dict[str, str]  # logs that gave no window, and why
    skipped: str | None = None  # why the logs cannot tell what it asks for


class Clock:
    """When a run started."""

    def __init__(self) -> None:
        self.utc = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        self._start_s = time.monotonic()

    def seconds(self) -> float:
        """Time since then."""
        return round(time.monotonic() - self._start_s, 3)


def run_record(
    matrix: Matrix, command: str, started: Clock, worker: Worker, outcomes: Mapping[str, Outcome]
) -> results.RunRecord:
    """Describe a run as far as it has come; `outcomes` are by the keys of units."""
    logs = [log for data in worker.data for log in data.records.values()]
    failed: dict[str, str] = {}
    for data in worker.data:  # a log to train on and one to score may have the same path in their folders
        for log, reason in data.failed.items():
            failed[log] = f"{failed[log]}; {reason}" if log in failed else reason
    return results.RunRecord(
        format_version=results.FORMAT_VERSION,
        title=matrix.title,
        command=command,
        matrix=matrix.model_dump(mode="json"),
        versions=versions(),
        machine=machine(worker.device, worker.threads),
        started=started.utc,
        seconds=started.seconds(),
        logs=tuple(sorted(logs, key=lambda log: log.path)),  # under one path, the log to score comes last
        failed_logs=failed | _too_short(outcomes),
        rows=tuple(_row_record(row, matrix.seed, outcomes) for row in matrix.rows),
    )


def _too_short(outcomes: Mapping[str, Outcome]) -> dict[str, str]:
    """Name the logs that gave some row no window."""
    found: dict[str, str] = {}
    for outcome in outcomes.values():
        for log, reason in outcome.left_out.items():
            found.setdefault(log, f"{log}: {reason}")
    return found


def _row_record(row: Row, first_seed: int, outcomes: Mapping[str, Outcome]) -> results.RowRecord:
    done = [outcomes[key] for key, _ in units_of(row, first_seed) if key in outcomes]
    failures = [outcome.failure for outcome in done if outcome.failure is not None]
    skipped = next((outcome.skipped for outcome in done if outcome.skipped is not None), None)
    found = [outcome.result_id for outcome in done if outcome.result_id is not None]
    return results.RowRecord(
        facts=row.facts,
        name=row.name,
        label=row.label,
        words=row.words,
        results=tuple(found),
        failure=failures[0] if failures else (None if done else results.NOT_RUN),
        skipped=skipped,
    )


def versions() -> dict[str, str]:
    """Return the version of this package, of Python and of what the numbers depend on; from a checkout, its commit."""
    found = {"semgrid-eval": semgrid_eval.__version__, "python": platform.python_version()}
    if commit := commit_of(Path(semgrid_eval.__file__).parent):
        found["semgrid-eval (commit)"] = commit
    return found | installed_versions(_NEEDED)


def machine(device: torch.device, threads: int) -> dict[str, str]:
    """Describe the machine, without its name, and the threads of each process that trains."""
    described = {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_cores": str(os.cpu_count()),
        "torch_threads": str(threads),
        "device": str(device),
    }
    if device.type == "cuda":
        described["gpu"] = torch.cuda.get_device_name(device)
    return described


@cache
def commit_of(package: Path) -> str | None:
    """Return the commit of the checkout that a package lies in, marked `-dirty` where files of it were changed.

    None where the package is not tracked, as in a virtual environment inside another project, or where git is absent.
    """
    try:
        _git(package, "ls-files", "--error-unmatch", "__init__.py")
        return _git(package, "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", folder, *arguments], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()
