"""Measures what a training on many recordings takes: anonymous memory, and its speed beside grids in memory.

The grids of a few recordings are repeated under other names, then a row of `paper-cpu` is trained on them and scored by
the path that a run takes. In the end updates on these grids and on the unrepeated ones in memory take turns.
"""

import multiprocessing
import re
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import torch

from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, Settings, times_as_fast
from semgrid_eval.config import parse_config
from semgrid_eval.executors import InProcess
from semgrid_eval.log.store import write_log
from semgrid_eval.models.fitting import Lesson
from semgrid_eval.models.network import ScheduleConfig
from semgrid_eval.models.stand_in import make_ready
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.job import Job
from semgrid_eval.runs.matrix import Matrix, load_matrix
from semgrid_eval.runs.packed import INDEX_FILE, PackedGrids, PackedIndex, pack_grids, write_index
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.seals import read_sealed_json
from semgrid_eval.windows.data import WindowSet
from semgrid_eval.windows.storage import Storage

MEMORY_AT_MOST_MIB, SPEED_AT_LEAST = 2048.0, 0.9
CPU = torch.device("cpu")
_ROW = "ED-DC"
_RECORDINGS = 12  # whose grids are repeated, and which are held in memory for comparison
_SAMPLE_S = 0.02
_ANONYMOUS = re.compile(r"RssAnon:\s+(\d+) kB")


def measure_memory(material: Material) -> Iterator[Measurement]:
    """Train on few and on many recordings, each in a process of its own, which no other part has grown."""
    settings = material.settings
    logs = _logs(material)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as apart:
        for count in settings.trained_recordings:
            yield from apart.submit(_measure, logs, material.folder / f"trained-{count}", count, settings).result()


def _logs(material: Material) -> Path:
    """Write the recording of the smallest pictures under several names, the last of them to be scored."""
    folder = material.folder / "trained-logs"
    recording = material.recording(material.smallest_px)
    for number in range(_RECORDINGS + 1):
        split = "train" if number < _RECORDINGS else "val"
        named = replace(recording, name=f"{recording.name}_{number:02d}", split=split)
        write_log(named, folder / split / f"{named.name}.mcap")
    return folder


def _measure(logs: Path, folder: Path, count: int, settings: Settings) -> list[Measurement]:
    """Train and score the row on so many recordings, then hold its speed against that of the unrepeated ones."""
    torch.set_num_threads(1)
    matrix, row = _one_row(settings.updates)
    data = RunData(logs, folder / "grids", [row], executor=InProcess(), device=CPU, stage=silent_stage)
    packed, repeated = folder / "packed", folder / "repeated"
    pack_grids(data, row.grid, packed)
    _repeat(packed, repeated, count)
    options = RunOptions("cpu", folder / "grids", "", executor=InProcess())
    with _watched() as most_mib:
        worker = make_worker(matrix, repeated, folder / "run", options, silent_stage)
        job = worker.look(row, matrix.seed)
        worker.run(row, matrix.seed)
    mapped = _windows(job)
    source = PackedGrids(packed, [row], Storage(CPU))
    held = _windows(replace(worker, training_data=source, scored_data=source).look(row, matrix.seed))
    speed = times_as_fast(lambda: _train(job, mapped), lambda: _train(job, held), settings.repeats)
    what = f"{len(mapped.data.recordings):,} recordings"
    return [
        Measurement(f"{what}, grids mapped", mapped.data.grids.nbytes / 2**20, "MiB"),
        Measurement(f"{what}, most anonymous memory", max(most_mib), "MiB", at_most=MEMORY_AT_MOST_MIB),
        Measurement(f"{what}, against grids in memory", speed, "times", at_least=SPEED_AT_LEAST),
    ]


def _one_row(updates: int) -> tuple[Matrix, Row]:
    """Return a matrix of one row, whose training makes so many updates."""
    matrix = load_matrix("paper-cpu")
    row = next(row for row in matrix.rows if row.name == _ROW)
    schedule = ScheduleConfig().model_dump(mode="json")
    sample = {"epochs": 1, "updates_per_epoch": updates, "epoch_unit": "batches", "schedule": schedule}
    settings = {**row.settings, "training": {**row.settings["training"], **sample}}
    row = row.model_copy(update={"settings": settings, "second_target": None})
    return matrix.model_copy(update={"rows": (row,)}), row


def _repeat(packed: Path, target: Path, count: int) -> None:
    """Give the recordings of the training split more names, up to so many; the others stay as they are."""
    file = packed / INDEX_FILE
    index = parse_config(PackedIndex, read_sealed_json(file), path=file)
    train = [log for log in index.logs if log.split == "train"]
    others = {log.path: log for log in index.logs if log.split != "train"}
    sources = others | {f"train/{number:06}.mcap": train[number % len(train)] for number in range(count)}
    for path, log in sources.items():
        link = (target / path).with_suffix(".npz")
        link.parent.mkdir(parents=True, exist_ok=True)
        link.hardlink_to((packed / log.path).with_suffix(".npz"))
    logs = tuple(log.model_copy(update={"path": path}) for path, log in sources.items())
    write_index(target, PackedIndex(grid=index.grid, logs=logs))


def _windows(job: Job) -> WindowSet:
    """Return the windows that a job learns from."""
    assert job.training is not None, "the row learns"
    return job.training.windows


def _train(job: Job, windows: WindowSet) -> None:
    """Train the network of a job on windows."""
    with tempfile.TemporaryDirectory() as folder:
        make_ready(
            job.resolved.model, job.resolved.settings, Lesson(job.row.given, 0, CPU, windows, folder=Path(folder))
        )


@contextmanager
def _watched() -> Iterator[list[float]]:
    """Look at the anonymous memory of this process while a block runs, and list what was found."""
    done, found_mib = threading.Event(), [_anonymous_mib()]

    def look() -> None:
        while not done.wait(_SAMPLE_S):
            found_mib.append(_anonymous_mib())

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield found_mib
    finally:
        done.set()
        thread.join()


def _anonymous_mib() -> float:
    """Return the anonymous memory of this process, as Linux tells it."""
    told = _ANONYMOUS.search(Path("/proc/self/status").read_text())
    return int(told[1]) / 1024 if told else 0.0
