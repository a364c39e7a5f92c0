"""The model behind a result, ready to predict again: what the result's id proves to be what was scored."""

from pathlib import Path
from typing import NamedTuple

from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.models.checkpoint import WEIGHTS_FILE, load_weights
from semgrid_eval.models.device import choose_device, seeded, settle_process
from semgrid_eval.models.fitting import Lesson, fit_model
from semgrid_eval.models.model import Model
from semgrid_eval.models.network import Network, seeded_network
from semgrid_eval.models.registry import MODELS, find_model, version_of
from semgrid_eval.playback.scored import Scored
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.job import id_of_result
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.scores.results import ResultRecord, read_run

_CPU = choose_device("cpu")


class Sources(NamedTuple):
    """Folders of a run, of its trainings, of its grids and of its logs."""

    run: Path
    trainings: Path
    grids: Path
    logs: Path


def row_of(scored: Scored) -> Row:
    """Return the row that a result is of, as it was scored.

    Raises:
        InputError: it is not to be predicted again: its code is another one now or one's own, or it is told what only
            a run can tell.
    """
    facts, config = scored.row.facts, scored.record.config
    if facts.model not in MODELS:
        raise InputError("its model is code of one's own, which only `semgrid-eval run` runs")
    if (scored_by := config.get("code")) != version_of(facts.model):
        raise InputError(f"version {scored_by} of its model was scored, and this is {version_of(facts.model)}")
    row = parse_config(
        Row, {"name": scored.row.name, **{key: config[key] for key in config if key in Row.model_fields}}
    )
    if row.asked is not None:
        raise InputError("its model is told of the truth, which only `semgrid-eval run` does")
    if row.answers_in is not None:
        raise InputError("its answers were made elsewhere")
    return row


def model_of(scored: Scored, row: Row, sources: Sources) -> Model:
    """Make the model of a result ready to predict on the CPU.

    A network gets the weights that the run has kept; what learns without gradients learns again, from the grids that
    the run has kept and the logs to train on.

    Raises:
        InputError: weights, grids or logs are not there, or are not those that the result was made with.
    """
    settle_process()
    made, record = find_model(row.model), scored.record
    settings = made.parse_settings(row.settings)
    if issubclass(made, Network):
        network = seeded_network(made, settings, row.given, record.seed or 0)
        load_weights(network, _training_of(record, row, sources.trainings) / WEIGHTS_FILE)
        return network.eval()
    if made.learns():
        return _learned_again(record, row, sources)
    with seeded(record.seed or 0, _CPU):
        return fit_model(made, settings, Lesson(row.given, record.seed or 0, _CPU)).model


def _training_of(record: ResultRecord, row: Row, trainings: Path) -> Path:
    """Find the folder of the training by which a result has its id."""
    config = {**record.config, "grid": row.grid.identity()}
    for folder in sorted(trainings.iterdir()) if trainings.is_dir() else ():
        if id_of_result(config, record.windows_id, folder.name, record.seed) == record.id:
            return folder
    raise InputError("its training is not among them; name their folder with --trainings", path=trainings)


def _learned_again(record: ResultRecord, row: Row, sources: Sources) -> Model:
    if not sources.grids.is_dir():
        raise InputError("it learns from grids that are not there; name their folder with --grids", path=sources.grids)
    matrix = Matrix(title="", seed=record.seed or 0, rows=(row,))
    worker = make_worker(matrix, sources.logs, sources.run, RunOptions("cpu", sources.grids, ""), silent_stage)
    # What is counted does not depend on threads, but ids of trainings do.
    worker.threads = int(read_run(sources.run).machine.get("torch_threads", worker.threads))
    job = worker.look(row, record.seed)
    if job.result_id != record.id:
        raise InputError("what it would learn here, from these logs, is not what it has learned", path=sources.logs)
    with seeded(record.seed or 0, _CPU):
        return worker.fitted(job).model
