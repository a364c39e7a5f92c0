"""Measures what a training on many recordings takes: anonymous memory, and its speed beside grids in memory.

The grids of a few recordings are repeated under other names, then a row of `paper-cpu` is trained on them and scored by
the path that a run takes. In the end updates on these grids and on the unrepeated ones in memory take turns.
"""

import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import torch

from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, Settings, apart, seconds_passed, times_as_fast
from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError
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
_CPU = torch.device("cpu")
_ROW = "ED-DC"
_RECORDINGS = 12  # whose grids are repeated, and which are held in memory for comparison
_SAMPLE_S = 0.02


def measure_memory(material: Material) -> Iterator[Measurement]:
    """Train on few and on many recordings, each in a process of its own, which no other part has grown."""
    settings = material.settings
    logs = _logs(material)
    for recordings in settings.trained_recordings:
        folder = material.folder / f"trained-{recordings}"
        yield from apart(partial(_measure, logs, folder, recordings, settings))


def _logs(material: Material) -> Path:
    """Write the recording of the smallest pictures under several names, the last of them to be scored."""
    folder = material.folder / "trained-logs"
    recording = material.recording(material.smallest_px)
    for number in range(_RECORDINGS + 1):
        split = "train" if number < _RECORDINGS else "val"
        named = replace(recording, name=f"{recording.name}_{number:02d}", split=split)
        write_log(named, folder / split / f"{named.name}.mcap")
    return folder


def _measure(logs: Path, folder: Path, recordings: int, settings: Settings) -> list[Measurement]:
    """Train and score the row on so many recordings, then hold its speed against that of the unrepeated ones."""
    torch.set_num_threads(1)
    matrix, row = _one_row(2 * settings.updates)
    data = RunData(logs, folder / "grids", [row], executor=InProcess(), device=_CPU, stage=silent_stage)
    packed, repeated = folder / "packed", folder / "repeated"
    pack_grids(data, row.grid, packed)
    _repeat(packed, repeated, recordings)
    options = RunOptions("cpu", folder / "grids", "", executor=InProcess())
    with _watched() as most_mib:
        worker = make_worker(matrix, repeated, folder / "run", options, silent_stage)
        job = worker.look(row, matrix.seed)
        worker.run(row, matrix.seed)
    mapped = _windows(job)
    source = PackedGrids(packed, [row], Storage(_CPU))
    held = _windows(replace(worker, training_data=source, scored_data=source).look(row, matrix.seed))
    held.data.grids.sum()  # gathers them
    seeds = (count(), count())  # other windows each time
    ours, rival = (lambda: _train(job, mapped, next(seeds[0]))), (lambda: _train(job, held, next(seeds[1])))
    speed = times_as_fast(ours, rival, settings.repeats, clock=seconds_passed)
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


def _repeat(packed: Path, target: Path, recordings: int) -> None:
    """Give the recordings of the training split more names, up to so many; the others stay as they are."""
    file = packed / INDEX_FILE
    index = parse_config(PackedIndex, read_sealed_json(file), path=file)
    train = [log for log in index.logs if log.split == "train"]
    others = {log.path: log for log in index.logs if log.split != "train"}
    sources = others | {f"train/{number:06}.mcap": train[number % len(train)] for number in range(recordings)}
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


def _train(job: Job, windows: WindowSet, seed: int) -> None:
    """Train the network of a job on windows."""
    with tempfile.TemporaryDirectory() as folder:
        lesson = Lesson(job.row.given, seed, _CPU, windows, folder=Path(folder))
        make_ready(job.resolved.model, job.resolved.settings, lesson)


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
    """Return the anonymous memory of this process, which a system cannot take back."""
    return _told_mib("RssAnon")


def most_memory_mib() -> float:
    """Return the most memory that this process has held."""
    return _told_mib("VmHWM")


def _told_mib(name: str) -> float:
    """Return a number that Linux tells of this process.

    Raises:
        InputError: this system does not tell.
    """
    try:
        told = re.search(rf"{name}:\s+(\d+) kB", Path("/proc/self/status").read_text())
    except OSError:
        told = None
    if told is None:
        raise InputError(f"memory is measured on Linux alone: no {name} in /proc/self/status")
    return int(told[1]) / 1024
