"""Works on units of a run: one row with one seed, fitted if need be, scored, and kept under the digest of all of it."""

import logging
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from semgrid_eval.arrays import write_arrays
from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.files import atomic_folder, digest_value
from semgrid_eval.grids.recording import FORMAT_VERSION as GRIDS
from semgrid_eval.grids.truth import Question, truth_versions
from semgrid_eval.models.checkpoint import HISTORY_FILE as TRAINING_HISTORY_FILE
from semgrid_eval.models.checkpoint import WEIGHTS_FILE, find_finished, read_history, write_history
from semgrid_eval.models.device import choose_precision, seeded
from semgrid_eval.models.fitting import Fitted, Lesson
from semgrid_eval.models.model import Model
from semgrid_eval.models.network import Network, NetworkSettings
from semgrid_eval.models.registry import MODELS, described, version_of
from semgrid_eval.models.stand_in import make_ready
from semgrid_eval.models.training import training_key
from semgrid_eval.progress import Stage
from semgrid_eval.runs.data import GridSource, grid_digest
from semgrid_eval.runs.job import Job, Resolved, Training, id_of_result, id_of_windows, target_key, window_records
from semgrid_eval.runs.recorded import RecordedRows
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.selection import Selection, Wanted
from semgrid_eval.runs.stream import block_records, identity_of, plan_row, stream_record
from semgrid_eval.runs.truth import EXPECTED, expected_target, parts_of, told
from semgrid_eval.runs.watch import unchanged
from semgrid_eval.scores import results
from semgrid_eval.scores.evaluate import Evaluation, evaluate
from semgrid_eval.scores.sums import EXPECTED_FILE, write_sums
from semgrid_eval.streams.evaluate import Unseen, evaluate_stream
from semgrid_eval.streams.plan import StreamPlan
from semgrid_eval.windows.data import WindowSet, window_arrays
from semgrid_eval.windows.grids import GridData
from semgrid_eval.windows.plan import TooEarlyError, training_windows, validation_windows

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class Worker:
    """Fits and scores single units; holds the grids that they share.

    Its methods raise a `SemgridError` where a row cannot be run; the message says why.
    """

    out: Path  # folder of the run
    trainings: Path  # folder of the trainings
    training_data: GridSource  # the grids to train on
    scored_data: GridSource  # the grids to score on, mostly the same
    device: torch.device  # where models run
    threads: int  # of numeric libraries where the units are worked on, which may be another process
    example_seed: int  # of the results whose predictions are kept for a report's examples
    stage: Stage  # shows progress
    any_machine: bool = False  # whether what was trained on another device or with other threads will do
    _windows: Selection = field(default_factory=Selection, init=False)
    _unseen: tuple[tuple[GridData, bytes], Unseen] | None = field(default=None, init=False)  # M of the last stream
    _recorded: RecordedRows = field(default_factory=RecordedRows, init=False)
    # Ids of the windows that are known to lie in the run's folder.
    _kept: set[str] = field(default_factory=set, init=False)

    @property
    def data(self) -> tuple[GridSource, ...]:
        """Where grids come from: one folder of logs, or one to train on and one to score on."""
        return tuple(dict.fromkeys((self.training_data, self.scored_data)))

    def look(self, row: Row, seed: int | None) -> Job:
        """Resolve a row with one seed into its model, its windows, its training and the id of its result."""
        model = described(row.model)
        resolved = Resolved(model, model.parse_settings(row.settings), version_of(row.model), row.model not in MODELS)
        stream = self.stream(row) if row.stream else None
        scored, left_out = (stream.answers, dict[str, str]()) if stream else self.scored_windows(row)
        windows_id = digest_value(stream.digest()) if stream else id_of_windows(row, scored)
        training = self._training(resolved, row, seed, scored) if resolved.model.learns() else None
        told = identity_of(row) | self._recorded.identity(row, scored)
        config = {**row.identity(), **told, "code": resolved.version}
        if asks_of_truth(row) and self.scored_data.cache is not None:
            config["truth"] = truth_versions()
        result_id = id_of_result(config, windows_id, training.id if training else None, seed)
        shown = {**config, "grid": row.grid.model_dump(mode="json")}
        return Job(row, seed, resolved, result_id, shown, scored, windows_id, training, left_out, stream)

    def stream(self, row: Row) -> StreamPlan:
        """Plan the stream of a row: over all recordings that are scored, from their first frames to their last."""
        data = self.scored_data.data(row.grid, row.scored_split)
        wanted = Wanted(row.scored_split, row.scored_window, validation_windows, (), row.hold_out, held_out=True)
        return plan_row(row, data, sorted(wanted.recordings(data.groups)), self._recorded.of(row))

    def scored_windows(self, row: Row) -> tuple[WindowSet, dict[str, str]]:
        """Select the windows on which a row is scored, and say why some logs give none; of a stream its answers."""
        if row.stream is not None:
            return self.stream(row).answers, {}
        data = self.scored_data
        wanted = Wanted(row.scored_split, row.scored_window, validation_windows, (), row.hold_out, held_out=True)
        undisturbed, too_short = self._windows.select(data, row, wanted)
        scored = undisturbed.disturbed(row.disturb, row.grid.spec)
        return scored, {data.log_of[scored.data.recordings[index]]: why for index, why in too_short.items()}

    def run(self, row: Row, seed: int | None) -> Job:
        """Make sure that the result of a row with one seed lies in the run's folder, and return what was resolved."""
        job = self.look(row, seed)
        self._keep_windows(job)
        folder = results.result_folder(self.out, job.result_id)
        if job.resolved.is_known and not self._is_to_be_made(job, folder):
            return job
        watched = unchanged(self.out, row.model) if job.resolved.is_own else nullcontext()
        with watched, seeded(seed or 0, self.device):
            fitted = self.fitted(job)
            evaluation = self._evaluated(job, fitted.model)
        self._keep_windows(job)  # code of one's own may have removed them
        record = self._result_record(job, fitted, evaluation)
        _keep_result(folder, record, evaluation, self._history(job), with_predictions=self._shows(job))
        return job

    def questions(self, row: Row) -> Iterator[Question]:
        """List what a row asks of the truth."""
        asked = [row.asked] if row.second_target is None else [row.asked, EXPECTED]
        for truth in filter(None, asked):
            yield from (part.question for part in parts_of(truth, self.scored_windows(row)[0], row.grid))

    def _evaluated(self, job: Job, model: Model) -> Evaluation:
        """Score a model on the windows of its row, telling it of the truth what it asks."""
        row, cache, scored = job.row, self.scored_data.cache, job.scored
        expected = expected_target(scored, row.grid, cache) if row.second_target else None
        if row.asked is not None:
            scored = replace(scored, truth=told(row.asked, scored, row.grid, cache))
        scored = replace(scored, answers=self._recorded.told(row, scored, job.stream))
        if job.stream is not None:
            return self._streamed(job, model, replace(job.stream, answers=scored))
        score = partial(evaluate, model, scored, mask_mode=row.mask_mode, spec=row.grid.spec, expected=expected)
        with self.stage(f"score {row.name}") as progress:
            return score(progress=progress)

    def _streamed(self, job: Job, model: Model, plan: StreamPlan) -> Evaluation:
        """Score a model on the times of evaluation of its row's stream."""
        row, nothing = job.row, np.empty(0, np.uint8)
        assert row.stream is not None
        with self.stage(f"score {row.name}") as progress:
            found = evaluate_stream(
                model,
                plan,
                spec=row.grid.spec,
                move=row.stream.move,
                mask_mode=row.mask_mode,
                unseen=self._unseen_at(plan),
                progress=progress,
            )
        return Evaluation(found.sums, nothing, nothing, found.seconds, stream=found.shown)

    def _unseen_at(self, plan: StreamPlan) -> Unseen:
        """Work M out for the times of evaluation of a stream, or find it as another row has left it."""
        key = (plan.answers.data, plan.evaluated.tobytes())
        if self._unseen is None or self._unseen[0][0] is not key[0] or self._unseen[0][1] != key[1]:
            self._unseen = key, Unseen(plan.answers.data, plan.evaluated)
        return self._unseen[1]

    def is_done(self, job: Job) -> bool:
        """Tell whether all that a job leaves lies in the run's folder."""
        return self._fault(job) is None

    def is_due(self, job: Job) -> bool:
        """Tell whether a job is to be worked on, if only since its model may read what is not known."""
        return not (job.resolved.is_known and self.is_done(job))

    def _is_to_be_made(self, job: Job, folder: Path) -> bool:
        """Tell whether a result is not done, and say so where there is something in its place."""
        fault = self._fault(job)
        if fault is not None and folder.exists():
            _log.warning("%s; the result is made again", fault)
        return fault is not None

    def _fault(self, job: Job) -> str | None:
        folder = results.result_folder(self.out, job.result_id)
        with_history = self._history(job) is not None
        return results.fault_of(folder, with_predictions=self._shows(job), with_history=with_history)

    def _shows(self, job: Job) -> bool:
        return job.seed in (None, self.example_seed)

    def _history(self, job: Job) -> Path | None:
        is_network = issubclass(job.resolved.model, Network)
        return job.training.folder / TRAINING_HISTORY_FILE if job.training and is_network else None

    def _watched(self, row: Row, scored: WindowSet) -> WindowSet | None:
        """Select the windows whose loss a training notes; they are the training logs' own, wherever it is scored.

        So one training serves the scores on all sorts of logs, and of disturbed inputs.
        """
        if self.scored_data is self.training_data and not row.train_leads and row.stream is None:
            return scored.disturbed(None, row.grid.spec)
        wanted = Wanted(row.scored_split, row.window, validation_windows, row.leads_frames, row.hold_out, held_out=True)
        try:
            return self._windows.select(self.training_data, row, wanted)[0]
        except TooEarlyError:
            raise
        except InputError:  # no such logs among them, and none is needed
            return None

    def _training(self, resolved: Resolved, row: Row, seed: int | None, scored: WindowSet) -> Training:
        wanted = Wanted(row.train_split, row.window, training_windows, row.leads_frames, row.hold_out)
        windows = self._windows.select(self.training_data, row, wanted)[0]
        watched = self._watched(row, scored) if issubclass(resolved.model, Network) else None
        # All that decides what a model learns.
        settings, precision = resolved.settings, ""
        if isinstance(settings, NetworkSettings):
            precision = str(choose_precision(settings.training.precision, self.device))
        training_id = digest_value(
            {
                "model": [resolved.model.__name__, resolved.version, settings.model_dump(mode="json")],
                "precision": precision,
                "device": self.device.type,
                # Sums on a CPU are rounded by how many threads share them.
                "threads": self.threads if self.device.type == "cpu" else None,
                "seed": seed,
                "windows": [windows.digest(), watched.digest() if watched else None],
                "grids": [GRIDS, grid_digest(row.grid), list(row.grid.classes.names)],
            }
        )
        folder = self.trainings / training_id
        if self.any_machine and issubclass(resolved.model, Network) and not (folder / WEIGHTS_FILE).is_file():
            key = training_key(resolved.model, settings, row.given, seed or 0, windows, watched)
            folder = find_finished(self.trainings, key) or folder
        return Training(folder.name, folder, windows, watched)

    def fitted(self, job: Job) -> Fitted:
        """Make the job's model ready to predict."""
        made, settings, seed = job.resolved.model, job.resolved.settings, job.seed or 0
        lesson = Lesson(job.row.given, seed, self.device)
        if job.training is None:
            return make_ready(made, settings, lesson)
        training, is_network = job.training, issubclass(made, Network)
        lesson = replace(lesson, windows=training.windows, watched=training.watched, folder=training.folder)
        with self.stage(f"train {job.row.name} (seed {seed})" if is_network else f"fit {job.row.name}") as progress:
            return make_ready(made, settings, lesson, progress)

    def _result_record(self, job: Job, fitted: Fitted, evaluation: Evaluation) -> results.ResultRecord:
        log_of = self.scored_data.log_of
        return results.ResultRecord(
            format_version=results.FORMAT_VERSION,
            id=job.result_id,
            facts=job.row.facts,
            targets=target_key(job),
            lead_s=round(float(job.scored.lead_s[:, -1].median()), 6) if len(job.scored) else 0.0,
            stream=stream_record(job.stream) if job.stream else None,
            config=job.config,
            log_digests=tuple(sorted(set(job.scored.data.digests))),
            seed=job.seed,
            windows_id=job.windows_id,
            windows=block_records(job.stream, log_of) if job.stream else window_records(job.scored, log_of),
            device=str(self.device),
            train_seconds=fitted.train_seconds,
            predict_seconds=round(evaluation.seconds, 6),
            parameters=fitted.parameters,
            has_expected=evaluation.expected_sums is not None,
        )

    def _keep_windows(self, job: Job) -> None:
        """Keep what a report's examples are made from; a stream has none."""
        windows, windows_id = job.scored, job.windows_id
        if job.stream is not None:
            return
        file = results.windows_file(self.out, windows_id)
        if windows_id in self._kept and file.exists():
            return
        try:
            results.read_windows(self.out, windows_id)
        except ResultError as error:  # not there yet, or damaged
            if file.exists():
                _log.warning("%s; the windows are kept again", error)
            write_arrays(file, window_arrays(windows), owner=windows_id)
        self._kept.add(windows_id)


def asks_of_truth(row: Row) -> bool:
    """Tell whether a row's model or its second target asks for the truth."""
    return row.asked is not None or row.second_target is not None


def _keep_result(
    folder: Path, record: results.ResultRecord, evaluation: Evaluation, history: Path | None, *, with_predictions: bool
) -> None:
    with atomic_folder(folder) as partial:
        write_sums(partial, evaluation.sums, record.id)
        if evaluation.expected_sums is not None:
            write_sums(partial, evaluation.expected_sums, record.id, EXPECTED_FILE)
        if with_predictions:
            arrays = {"prediction": evaluation.prediction, "certainty": evaluation.certainty}
            file = results.STREAM_FILE if evaluation.stream else results.PREDICTIONS_FILE
            write_arrays(partial / file, evaluation.stream or arrays, owner=record.id)
        if history:
            write_history(partial / results.HISTORY_FILE, read_history(history), owner=record.id)
        results.write_result(partial, record)
