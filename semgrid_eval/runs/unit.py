"""One unit of a run: one row with one seed, trained if need be, scored, and kept under the digest of all of it."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.files import atomic_folder, digest_files, digest_value
from semgrid_eval.grids.build import FORMAT_VERSION as GRIDS
from semgrid_eval.models.baselines import FuseAll, OverlaySensors, RepeatNewest
from semgrid_eval.models.checkpoint import HISTORY_FILE as TRAINING_HISTORY_FILE
from semgrid_eval.models.device import choose_precision
from semgrid_eval.models.flow import MoveOn
from semgrid_eval.models.network import NetworkPredictor
from semgrid_eval.models.predictor import Predictor, installed_models, load_predictor
from semgrid_eval.models.table import count_table
from semgrid_eval.models.training import Trained, train
from semgrid_eval.progress import Stage
from semgrid_eval.runs.matrix import Row
from semgrid_eval.runs.sources import Sources, grid_digest
from semgrid_eval.scores import results
from semgrid_eval.scores.evaluate import Evaluation, evaluate
from semgrid_eval.windows.data import WindowSet, select_windows, window_arrays
from semgrid_eval.windows.plan import WindowConfig, WindowPlan, training_windows, validation_windows

SCORING_VERSION = 3
"""Counts changes to how windows are kept and scored; results of another version are made anew."""

WindowPlanner = Callable[[Sequence[int], WindowConfig], WindowPlan]


class Worker:
    """Trains and scores single units; holds the grids that they share.

    Args:
        out: folder of the run.
        sources: the grids to train on.
        device: where models run.
        example_seed: of the trained results whose predictions are kept for a report's examples.
        stage: shows progress.
        scored_sources: the grids to score on, where they are others.
        trainings: folder of the trainings, where it is not the run's own.
        threads: of numeric libraries where the units are worked on, which may be another process.
    """

    def __init__(
        self,
        out: Path,
        sources: Sources,
        device: torch.device,
        example_seed: int,
        stage: Stage,
        *,
        scored_sources: Sources | None = None,
        trainings: Path | None = None,
        threads: int | None = None,
    ) -> None:
        self.threads = threads or torch.get_num_threads()
        self._out, self.device, self._stage, self._example_seed = out, device, stage, example_seed
        self._sources, self._scored_sources = sources, scored_sources or sources
        self._trainings = trainings or out / "trainings"
        self._selected: dict[object, tuple[WindowSet, dict[int, str]]] = {}
        self._kept: set[str] = set()  # ids of the windows that are known to lie in the run's folder

    @property
    def sources(self) -> tuple[Sources, ...]:
        """Where grids come from: one folder of logs, or one to train on and one to score on."""
        return tuple(dict.fromkeys((self._sources, self._scored_sources)))

    def look(self, row: Row, seed: int | None) -> "Job":
        """Resolve a row with one seed into its windows, its training and the id of its result.

        Raises:
            SemgridError: the row cannot be run; the message says why.
        """
        scored, left_out = self.scored_windows(row)
        windows_id = digest_value([SCORING_VERSION, GRIDS, scored.digest(), grid_digest(row.grid), list(CLASS_NAMES)])
        training = self._training(row, seed, self._watched(row, scored)) if seed is not None else None
        counted = self._training_windows(row) if row.model == "table" else None
        config = _config(row)
        learned_from = training.id if training else counted.digest() if counted is not None else None
        result_id = digest_value([results.FORMAT_VERSION, SCORING_VERSION, config, windows_id, learned_from])
        return Job(result_id, config, scored, windows_id, training, counted, left_out)

    def scored_windows(self, row: Row) -> tuple[WindowSet, dict[str, str]]:
        """Select the windows on which a row is scored, and say why some logs give none.

        Raises:
            SemgridError: there is no such window.
        """
        sources = self._scored_sources
        scored, too_short = self._select(sources, row, row.validation_split, row.scored_window, validation_windows)
        return scored, {sources.log_of[scored.data.recordings[index]]: why for index, why in too_short.items()}

    def run(self, row: Row, seed: int | None) -> "Job":
        """Make sure that the result of a row with one seed lies in the run's folder, and return what was resolved.

        Raises:
            SemgridError: the row cannot be run; the message says why.
        """
        job = self.look(row, seed)
        folder = results.result_folder(self._out, job.result_id)
        self._keep_windows(job.scored, job.windows_id)
        # A model of one's own is scored each time: nobody knows all files that its numbers depend on.
        if row.built_in and self.is_done(job):
            return job
        trained = self._train(job.training, row) if job.training else None
        predictor = _predictor(row, trained, job.counted, self.device)
        with self._stage(f"score {row.name}") as progress:
            evaluation = evaluate(predictor, job.scored, mask_mode=row.mask_mode, spec=row.grid.spec, progress=progress)
        record = results.ResultRecord(
            format_version=results.FORMAT_VERSION,
            id=job.result_id,
            facts=row.facts,
            targets=target_key(row, job.scored),
            lead_s=round(float(job.scored.lead_s[:, -1].median()), 6),
            config=job.config,
            log_digests=tuple(sorted(set(job.scored.data.digests))),
            seed=seed,
            windows_id=job.windows_id,
            windows=_window_records(job.scored, self._scored_sources.log_of),
            device=str(self.device),
            train_seconds=round(trained.seconds, 3) if trained else None,
            predict_seconds=round(evaluation.seconds, 6),
            parameters=trained.network.parameter_count if trained else None,
        )
        history = job.training.folder / TRAINING_HISTORY_FILE if job.training else None
        _keep_result(folder, record, evaluation, history, with_predictions=self._shows(seed))
        return job

    def is_done(self, job: "Job") -> bool:
        """Tell whether all that a job leaves lies in the run's folder."""
        folder = results.result_folder(self._out, job.result_id)
        seed = job.training.seed if job.training else None
        return results.is_done(folder, with_predictions=self._shows(seed), with_history=job.training is not None)

    def _shows(self, seed: int | None) -> bool:
        return seed in (None, self._example_seed)

    def _select(
        self, sources: Sources, row: Row, split: str, config: WindowConfig, plan: WindowPlanner
    ) -> tuple[WindowSet, dict[int, str]]:
        """Select windows once for all seeds and rows that share them, with the reasons why recordings are too short."""
        key = (sources, grid_digest(row.grid), split, config, row.sensors, row.translate, plan)
        if key not in self._selected:
            data = sources.data(row.grid, split)
            planned = plan(data.frame_counts, config)
            windows = select_windows(data, planned.windows, sensors=row.sensors, translate=row.translate)
            self._selected[key] = windows, planned.too_short
        return self._selected[key]

    def _training_windows(self, row: Row) -> WindowSet:
        return self._select(self._sources, row, row.train_split, row.window, training_windows)[0]

    def _watched(self, row: Row, scored: WindowSet) -> WindowSet | None:
        """Select the windows whose loss a training notes; they are the training logs' own, wherever it is scored.

        So one training serves the scores on all sorts of logs.
        """
        if self._scored_sources is self._sources:
            return scored
        try:
            return self._select(self._sources, row, row.validation_split, row.window, validation_windows)[0]
        except InputError:  # no such logs among them, and none is needed
            return None

    def _training(self, row: Row, seed: int, watched: WindowSet | None) -> "Training":
        windows = self._training_windows(row)
        # Whoever changes what a training makes of the same settings and logs adds a version here.
        training_id = digest_value(
            {
                "network": row.network.model_dump(),
                "training": row.training.model_dump(),
                "precision": str(choose_precision(row.training.precision, self.device)),
                "device": self.device.type,
                # Sums on a CPU are rounded by how many threads share them.
                "threads": self.threads if self.device.type == "cpu" else None,
                "seed": seed,
                "windows": [windows.digest(), watched.digest() if watched else None, grid_digest(row.grid)],
            }
        )
        return Training(training_id, self._trainings / training_id, seed, windows, watched)

    def _train(self, job: "Training", row: Row) -> Trained:
        with self._stage(f"train {row.name} (seed {job.seed})") as progress:
            return train(
                job.windows,
                row.network,
                row.training,
                seed=job.seed,
                device=self.device,
                folder=job.folder,
                progress=progress,
                validation=job.watched,
            )

    def _keep_windows(self, windows: WindowSet, windows_id: str) -> None:
        if windows_id in self._kept:
            return
        try:
            results.read_windows(self._out, windows_id)
        except ResultError:  # not there yet, or damaged
            write_arrays(results.windows_file(self._out, windows_id), window_arrays(windows))
        self._kept.add(windows_id)


@dataclass(frozen=True)
class Job:
    """A row with one seed, resolved.

    Args:
        result_id: names the result's folder.
        config: what determined it, for the record.
        scored: validation windows; `windows_id` names their file.
        training: what has to be trained, if anything.
        counted: training windows of BL-Table.
        left_out: logs whose recordings are too short for the row's windows, and by how much.
    """

    result_id: str
    config: dict[str, object]
    scored: WindowSet
    windows_id: str
    training: "Training | None"
    counted: WindowSet | None
    left_out: dict[str, str]


@dataclass(frozen=True)
class Training:
    """A training that a row asks for, with the windows whose loss it notes; rows that ask for the same one share it."""

    id: str
    folder: Path
    seed: int
    windows: WindowSet
    watched: WindowSet | None


def target_key(row: Row, scored: WindowSet) -> str:
    """Digest what rows must share to be subtracted: target frames of which logs, their grids, mask mode and split."""
    frames = scored.target_frames.cpu().numpy()
    owners, places = scored.data.locate(frames)
    digests = [scored.data.digests[owner] for owner in owners]
    targets = sorted(zip(digests, scored.data.stamps_ns[frames].tolist(), places.tolist(), strict=True))
    return digest_value([targets, grid_digest(row.grid), row.mask_mode, row.validation_split, list(CLASS_NAMES)])


def identity(row: Row) -> dict[str, object]:
    """Return what of a row determines its numbers: everything but its names and its number of repeats."""
    unused = {"name", "experiment", "repeats"} | (set() if row.trained else {"network", "training"})
    unused |= set() if row.model == "flow" else {"flow"}
    return row.model_dump(mode="json", exclude=unused)


def _config(row: Row) -> dict[str, object]:
    """Return a row's identity and, for a model of one's own, the digest of its code, or its package and version."""
    if row.built_in:
        return identity(row)
    path, separator, _ = row.model.rpartition(":")
    code = digest_files([Path(path)]) if separator else installed_models().get(row.model)
    return {**identity(row), "code": code}


def _predictor(row: Row, trained: Trained | None, counted: WindowSet | None, device: torch.device) -> Predictor:
    if trained:
        return NetworkPredictor(trained.network, trained.dtype)
    if counted is not None:
        return count_table(counted)
    match row.model:
        case "newest":
            return RepeatNewest()
        case "overlay":
            return OverlaySensors(next(sensor for sensor in row.sensors if row.overlay in sensor))
        case "fuse":
            return FuseAll()
        case "flow":
            return MoveOn(row.flow, row.grid.spec.cell_m)
    return load_predictor(row.model, device)


def _window_records(windows: WindowSet, log_of: dict[str, str]) -> tuple[results.WindowRecord, ...]:
    data = windows.data
    frames, inputs = windows.target_frames.cpu().numpy(), windows.inputs.cpu().numpy()
    return tuple(
        results.WindowRecord(
            recording=data.recordings[owner],
            log=log_of[data.recordings[owner]],
            target_frame=int(target),
            target_stamp_ns=int(data.stamps_ns[frame]),
            input_stamps_ns=tuple(data.stamps_ns[past].tolist()),
        )
        for frame, past, owner, target in zip(frames, inputs, *data.locate(frames), strict=True)
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
        results.write_sums(partial, evaluation.sums)
        if with_predictions:
            arrays = {"prediction": evaluation.prediction, "certainty": evaluation.certainty}
            write_arrays(partial / results.PREDICTIONS_FILE, arrays)
        if history:
            shutil.copyfile(history, partial / results.HISTORY_FILE)
        results.write_result(partial, record)
