"""Works off a matrix: every training and every score is a folder named by the digest of all that determines it."""

import datetime
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import SemgridError
from semgrid_eval.files import atomic_folder, digest_files, digest_value
from semgrid_eval.models.baselines import FuseAll, OverlaySensors, RepeatNewest
from semgrid_eval.models.checkpoint import HISTORY_FILE
from semgrid_eval.models.device import choose_device, choose_precision, keep_freed_memory
from semgrid_eval.models.network import NetworkPredictor
from semgrid_eval.models.predictor import Predictor, load_predictor
from semgrid_eval.models.training import Trained, train
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.runs.matrix import Matrix, Row
from semgrid_eval.runs.provenance import machine, versions
from semgrid_eval.runs.sources import Sources, grid_digest
from semgrid_eval.scores import results
from semgrid_eval.scores.evaluate import Evaluation, evaluate
from semgrid_eval.sequences.dataset import WindowSet, select_windows, window_arrays
from semgrid_eval.sequences.windows import WindowConfig, WindowPlan, training_windows, validation_windows


@dataclass(frozen=True)
class RunOptions:
    """What does not change the numbers of a run on one machine.

    Args:
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...
        workers: logs built into grids at once.
        grids: folder in which grids are kept.
        command: how the run was started, for the record.
    """

    device: str
    workers: int
    grids: Path
    command: str


def run_matrix(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> results.RunRecord:
    """Train and score every row; what is done already is kept, a row that fails is noted and the rest goes on.

    Raises:
        InputError: there is no log at all, or the device does not exist.
    """
    keep_freed_memory()
    device = choose_device(options.device)
    started = datetime.datetime.now(datetime.UTC)
    start_s = time.monotonic()
    sources = Sources(logs, options.grids, matrix.rows, workers=options.workers, device=device, stage=stage)
    runner = _Runner(matrix, out, sources, device, stage)

    def record(rows: list[results.RowRecord]) -> results.RunRecord:
        return results.RunRecord(
            format_version=results.FORMAT_VERSION,
            title=matrix.title,
            command=options.command,
            matrix=matrix.model_dump(mode="json"),
            versions=versions(),
            machine=machine(device),
            started=started.isoformat(timespec="seconds"),
            seconds=round(time.monotonic() - start_s, 3),
            logs=tuple(sources.records[key] for key in sorted(sources.records)),
            failed_logs=sources.failed,
            rows=tuple(rows),
        )

    rows: list[results.RowRecord] = []
    for row in matrix.rows:
        rows.append(runner.run_row(row))
        latest = record(rows)
        results.write_run(out, latest)  # a run that is stopped can be reported as far as it came
    return latest


class _Runner:
    """Runs rows one after the other."""

    def __init__(self, matrix: Matrix, out: Path, sources: Sources, device: torch.device, stage: Stage) -> None:
        self._matrix, self._out, self._sources, self._device, self._stage = matrix, out, sources, device, stage

    def run_row(self, row: Row) -> results.RowRecord:
        """Run all repeats of a row, or say why it failed."""
        done: list[str] = []
        failure: str | None = None
        try:
            for repeat in range(row.repeats if row.trained else 1):
                done.append(self._run_once(row, repeat))
        except SemgridError as error:
            failure = str(error)
        return results.RowRecord(
            name=row.name,
            experiment=row.group,
            model="ED" if row.trained else row.name.split("-")[0],
            label=row.label,
            inputs=row.window.inputs,
            step_frames=row.window.step_frames,
            horizon_steps=row.window.horizon_steps,
            sensors=row.sensors,
            translate=row.translate,
            results=tuple(done),
            failure=failure,
        )

    def _run_once(self, row: Row, repeat: int) -> str:
        scored = self._window_set(row, row.validation_split, validation_windows)
        windows_id = digest_value([scored.digest(), grid_digest(row.grid), list(CLASS_NAMES)])
        job = self._training(row, repeat) if row.trained else None
        config = _identity(row)
        result_id = digest_value([results.FORMAT_VERSION, config, windows_id, job.id if job else None])
        folder = results.result_folder(self._out, result_id)
        if results.is_done(folder):
            return result_id
        trained = self._train(job, row) if job else None
        with self._stage(f"score {row.name}") as progress:
            evaluation = evaluate(_predictor(row, trained), scored, progress=progress)
        self._keep_windows(scored, windows_id)
        record = results.ResultRecord(
            format_version=results.FORMAT_VERSION,
            id=result_id,
            config=config,
            log_digests=tuple(sorted(set(scored.data.digests))),
            seed=job.seed if job else None,
            windows_id=windows_id,
            windows=_window_records(scored, self._sources.log_of),
            device=str(self._device),
            train_seconds=round(trained.seconds, 3) if trained else None,
            predict_seconds=round(evaluation.seconds, 6),
            parameters=trained.network.parameter_count if trained else None,
        )
        history = job.folder / HISTORY_FILE if job else None
        _keep_result(folder, record, evaluation, history, with_predictions=repeat == 0)
        return result_id

    def _window_set(self, row: Row, split: str, plan: Callable[[list[int], WindowConfig], WindowPlan]) -> WindowSet:
        data = self._sources.data(row.grid, split)
        windows = plan(data.frame_counts, row.window).windows
        return select_windows(data, windows, sensors=row.sensors, translate=row.translate)

    def _training(self, row: Row, repeat: int) -> "_Training":
        windows = self._window_set(row, row.train_split, training_windows)
        watched = self._window_set(row, row.validation_split, validation_windows)
        seed = self._matrix.seed + repeat
        training_id = digest_value(
            {
                "network": row.network.model_dump(),
                "training": row.training.model_dump(),
                "precision": str(choose_precision(row.training.precision, self._device)),
                "device": self._device.type,
                "seed": seed,
                "windows": [windows.digest(), watched.digest(), grid_digest(row.grid)],
            }
        )
        return _Training(training_id, self._out / "trainings" / training_id, seed, windows, watched)

    def _train(self, job: "_Training", row: Row) -> Trained:
        with self._stage(f"train {row.name} (seed {job.seed})") as progress:
            return train(
                job.windows,
                row.network,
                row.training,
                seed=job.seed,
                device=self._device,
                folder=job.folder,
                progress=progress,
                validation=job.watched,
            )

    def _keep_windows(self, windows: WindowSet, windows_id: str) -> None:
        path = results.windows_file(self._out, windows_id)
        if not path.is_file():
            write_arrays(path, window_arrays(windows))


@dataclass(frozen=True)
class _Training:
    """A training that a row asks for; rows that ask for the same one share its folder."""

    id: str
    folder: Path
    seed: int
    windows: WindowSet
    watched: WindowSet


def _identity(row: Row) -> dict[str, object]:
    """Return what determines a row's numbers: everything but its names and its number of repeats."""
    unused = {"name", "experiment", "repeats"} | (set() if row.trained else {"network", "training"})
    identity: dict[str, object] = row.model_dump(mode="json", exclude=unused)
    if ":" in row.model:
        identity["code"] = digest_files([Path(row.model.rpartition(":")[0])])
    return identity


def _predictor(row: Row, trained: Trained | None) -> Predictor:
    if trained:
        return NetworkPredictor(trained.network, trained.dtype)
    if row.model == "newest":
        return RepeatNewest()
    if row.model == "overlay":
        return OverlaySensors(next(sensor for sensor in row.sensors if row.overlay in sensor))
    if row.model == "fuse":
        return FuseAll()
    return load_predictor(row.model)


def _window_records(windows: WindowSet, log_of: dict[str, str]) -> tuple[results.WindowRecord, ...]:
    data = windows.data
    frames = windows.target_frames.cpu().numpy()
    owners = np.searchsorted(data.first_frames, frames, side="right") - 1
    return tuple(
        results.WindowRecord(
            recording=data.recordings[owner],
            log=log_of[data.recordings[owner]],
            target_frame=int(frame - data.first_frames[owner]),
            target_stamp_ns=int(data.stamps_ns[frame]),
        )
        for frame, owner in zip(frames, owners, strict=True)
    )


def _keep_result(
    folder: Path,
    record: results.ResultRecord,
    evaluation: Evaluation,
    history: Path | None,
    *,
    with_predictions: bool,
) -> None:
    with atomic_folder(folder) as partial:
        write_arrays(partial / "counts.npz", {"counts": evaluation.counts})
        if with_predictions:  # a report shows examples of one training of each row
            arrays = {"prediction": evaluation.prediction, "certainty": evaluation.certainty}
            write_arrays(partial / "predictions.npz", arrays)
        if history:
            shutil.copyfile(history, partial / "history.csv")
        results.write_result(partial, record)
