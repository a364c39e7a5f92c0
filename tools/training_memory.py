"""What a training on many recordings takes: anonymous memory of each stage, and its speed beside grids in memory.

The grids of a folder of logs are repeated under other names, then a row of `paper-cpu` is trained on them and scored by
the path that a run takes. At the end updates on these grids and on the unrepeated ones in memory take turns.

Example: python tools/training_memory.py LOGS /tmp/many --recordings 30000
"""

import argparse
import os
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import torch

from semgrid_eval.config import parse_config
from semgrid_eval.executors import InProcess, local_executor
from semgrid_eval.models.fitting import Lesson
from semgrid_eval.models.network import ScheduleConfig
from semgrid_eval.models.stand_in import make_ready
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.job import Job
from semgrid_eval.runs.matrix import Matrix, load_matrix
from semgrid_eval.runs.packed import INDEX_FILE, PackedGrids, PackedIndex, is_packed, pack_grids, write_index
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.runs.worker import Worker
from semgrid_eval.seals import read_sealed_json
from semgrid_eval.windows.data import WindowSet
from semgrid_eval.windows.storage import Storage

CPU = torch.device("cpu")
SAMPLE_S = 0.02
MIB = 1024  # KiB
_FIELD = re.compile(r"Rss(Anon|File|Shmem):\s+(\d+) kB")


@dataclass(frozen=True)
class Folders:
    """Where everything lies."""

    logs: Path
    out: Path

    @property
    def packed(self) -> Path:
        """The grids as they are."""
        return self.out / "packed"

    def repeated(self, count: int) -> Path:
        """The grids repeated to so many recordings."""
        return self.out / f"repeated-{count}"


def main() -> None:
    """Print a line for each stage, and one for each pair of speeds."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", type=Path)
    parser.add_argument("out", type=Path, help="folder for grids, links to them and the run")
    parser.add_argument("--row", default="ED-DC", help="of the preset paper-cpu")
    for name, number in (("recordings", 30_000), ("updates", 20), ("pairs", 5)):
        parser.add_argument(f"--{name}", type=int, default=number)
    options = parser.parse_args()
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS", "1")))
    matrix, row = wanted(options.row, options.updates)
    folders = Folders(options.logs, options.out)
    pack(folders, row)
    repeat(folders, options.recordings)
    with staged("start"):
        pass
    job, worker = trained(matrix, row, folders, options.recordings)
    for line in speeds(job, in_memory(worker, folders, row), options.pairs):
        say(line)


def wanted(name: str, updates: int) -> tuple[Matrix, Row]:
    """Return a matrix of one row, whose training makes so many updates."""
    matrix = load_matrix("paper-cpu")
    row = next(row for row in matrix.rows if row.name == name)
    schedule = ScheduleConfig().model_dump(mode="json")
    sample = {"epochs": 1, "updates_per_epoch": updates, "epoch_unit": "batches", "schedule": schedule}
    settings = {**row.settings, "training": {**row.settings["training"], **sample}}
    row = row.model_copy(update={"settings": settings, "second_target": None})
    return matrix.model_copy(update={"rows": (row,)}), row


def pack(folders: Folders, row: Row) -> None:
    """Pack the grids of the logs, if that is not done yet."""
    if not is_packed(folders.packed):
        executor = local_executor(2)
        data = RunData(folders.logs, folders.out / "grids", [row], executor=executor, device=CPU, stage=silent_stage)
        pack_grids(data, row.grid, folders.packed)


def repeat(folders: Folders, count: int) -> None:
    """Give the recordings of the training split more names, up to so many; the others stay as they are."""
    target = folders.repeated(count)
    if is_packed(target):
        return
    file = folders.packed / INDEX_FILE
    index = parse_config(PackedIndex, read_sealed_json(file), path=file)
    train = [log for log in index.logs if log.split == "train"]
    others = {log.path: log for log in index.logs if log.split != "train"}
    sources = others | {f"train/{number:06}.mcap": train[number % len(train)] for number in range(count)}
    for path, log in sources.items():
        link = (target / path).with_suffix(".npz")
        link.parent.mkdir(parents=True, exist_ok=True)
        link.unlink(missing_ok=True)
        link.hardlink_to((folders.packed / log.path).with_suffix(".npz"))
    logs = tuple(log.model_copy(update={"path": path}) for path, log in sources.items())
    write_index(target, PackedIndex(grid=index.grid, logs=logs))


def trained(matrix: Matrix, row: Row, folders: Folders, count: int) -> tuple[Job, Worker]:
    """Train and score the row as a run does, and say what each stage takes."""
    with tempfile.TemporaryDirectory(dir=folders.out) as run:
        options = RunOptions("cpu", folders.out / "grids", "", executor=InProcess())
        with staged("find recordings, plan windows"):
            worker = make_worker(matrix, folders.repeated(count), Path(run), options, silent_stage)
            job = worker.look(row, matrix.seed)
        windows = training_of(job)
        say(f"{len(windows.data.recordings):,} recordings, {len(windows):,} windows, {len(job.scored):,} scored")
        with staged("gather grids"):
            grids = windows.data.grids
        say(f"{grids.nbytes / 2**30:.1f} GiB of grids")
        with staged("train, score"):
            worker.run(row, matrix.seed)
    return job, worker


def in_memory(worker: Worker, folders: Folders, row: Row) -> WindowSet:
    """Return the windows of the unrepeated grids, which lie in memory."""
    source = PackedGrids(folders.packed, [row], Storage(CPU))
    windows = training_of(replace(worker, training_data=source, scored_data=source).look(row, worker.example_seed))
    say(f"in memory: {len(windows.data.recordings):,} recordings, {windows.data.grids.nbytes / 2**20:.0f} MiB")
    return windows


def training_of(job: Job) -> WindowSet:
    """Return the windows that a job learns from."""
    assert job.training is not None, "the row learns"
    return job.training.windows


def speeds(job: Job, held: WindowSet, pairs: int) -> Iterator[str]:
    """Train in turn on mapped grids and on grids in memory: yield updates a second, and the ratios of all pairs."""
    ratios: list[tuple[float, float]] = []
    for _ in range(pairs):
        mapped, memory = timed(job, training_of(job)), timed(job, held)
        ratios.append((memory[0] / mapped[0], memory[1] / mapped[1]))
        updates = job.resolved.settings.training.updates_per_epoch  # type: ignore[attr-defined] # of a network
        yield f"updates a second: mapped {updates / mapped[0]:.2f}, in memory {updates / memory[0]:.2f}"
    wall, processor = (median(column) for column in zip(*ratios, strict=True))
    yield f"speed of mapped grids against grids in memory, median: {wall:.3f} by the clock, {processor:.3f} by CPU time"


def timed(job: Job, windows: WindowSet) -> tuple[float, float]:
    """Train on windows: seconds of the updates, and CPU seconds of the training."""
    with tempfile.TemporaryDirectory() as folder:
        lesson = Lesson(job.row.given, 0, CPU, windows, folder=Path(folder))
        start_s = time.process_time()
        fitted = make_ready(job.resolved.model, job.resolved.settings, lesson)
        return sum(fitted.epochs_s or ()), time.process_time() - start_s


@contextmanager
def staged(name: str) -> Iterator[None]:
    """Say how long a block takes, and the most anonymous memory that this process had in it."""
    peak_kib, done = [rss_kib()["Anon"]], threading.Event()

    def look() -> None:
        while not done.wait(SAMPLE_S):
            peak_kib.append(max(peak_kib.pop(), rss_kib()["Anon"]))

    thread, start_s = threading.Thread(target=look), time.perf_counter()
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
    now = rss_kib()
    peak = max(peak_kib[0], now["Anon"]) / MIB
    seconds = time.perf_counter() - start_s
    say(f"{name}: {seconds:.0f} s, RssAnon {peak:,.0f} MiB at most, {now['Anon'] / MIB:,.0f} MiB at its end")


def rss_kib() -> dict[str, int]:
    """Return the memory of this process by kind, as Linux tells it."""
    return {kind: int(size) for kind, size in _FIELD.findall(Path("/proc/self/status").read_text())}


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
