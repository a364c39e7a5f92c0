"""The public functions: from a log to grids, windows, scores, runs and reports, each in one call."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.executors import local_executor
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log import check, store
from semgrid_eval.log.convert import ConversionSummary, Work
from semgrid_eval.log.findings import LogReport
from semgrid_eval.log.reader import LogReader
from semgrid_eval.models import registry
from semgrid_eval.models.device import choose_device, settle_process
from semgrid_eval.models.memory import guest_limits
from semgrid_eval.models.model import Given, Model
from semgrid_eval.models.network import Network, seeded_network
from semgrid_eval.models.training import train
from semgrid_eval.recording.types import Recording
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores.metrics.iou import confusion
from semgrid_eval.scores.metrics.table import iou_of
from semgrid_eval.scores.results import RunRecord
from semgrid_eval.scores.tidy import load_figures
from semgrid_eval.sources.known import SOURCES, load_source
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


def convert(source: str, out: Path | str, *, workers: int = 1, **options: Any) -> ConversionSummary:  # noqa: ANN401
    """Convert what a source offers to logs OUT/<split>/<name>.mcap; what is done already is kept.

    Args:
        source: one that `semgrid-eval convert --help` lists, such as `cityscapes`, `ros2` or `synthetic`.
        out: folder of the logs.
        workers: how many logs are written at once.
        options: those of the source's command, with underscores.

    Raises:
        ConfigError: there is no such source or option.
        MissingExtraError: a package of its extra is not installed.
    """
    if source not in SOURCES:
        raise ConfigError(f"{source!r} is not one of {', '.join(SOURCES)}", field="source")
    found = load_source(source)
    work = Work(workers, local_executor(workers))
    return found.convert(parse_config(found.options, options, path=source), Path(out), work)


def open_log(path: Path | str) -> LogReader:
    """Open a log, to be used in a `with` block: `frames`, `motion`, `calibration`, `pictures` and more.

    Raises:
        LogError: the file cannot be read, is damaged, or is not a log of this package.
    """
    return LogReader(Path(path))


def write_log(recording: Recording, path: Path | str) -> None:
    """Write a recording of whatever source as a log, moment by moment; an InputError leaves nothing behind."""
    store.write_log(recording, Path(path))


def check_log(path: Path | str) -> LogReport:
    """Check a log as `semgrid-eval check` does; what is wrong with it is a finding, no exception."""
    return check.check_log(Path(path))


def find_logs(folder: Path | str) -> list[Path]:
    """List all logs below a folder, sorted by path.

    Raises:
        InputError: the folder does not exist or holds no log.
    """
    return store.find_logs(Path(folder))


def build_grids(log: Path | str, config: GridConfig | None = None) -> list[GridRecording]:
    """Make the semantic grids of all sensors of one log; a long log is cut into several recordings.

    Raises:
        LogError: the log is damaged or lacks what a grid needs.
    """
    return build_log(Path(log), config or GridConfig())


def plot_grid(
    grid: NDArray[np.uint8],
    *,
    mask: NDArray[np.bool_] | None = None,
    spec: GridSpec | None = None,
    classes: ClassSet = DEFAULT_CLASSES,
    axes: "Axes | None" = None,  # those of a new figure if not given
) -> "Axes":
    """Draw a grid (H, W) of class ids in the report's colours, in metres around the vehicle, mask M (H, W) in white."""
    from semgrid_eval.report.figures.grid import draw_grid  # so that matplotlib is imported only to plot

    return draw_grid(grid, mask=mask, spec=spec or GridSpec(), classes=classes, axes=axes)


def score(
    target: NDArray[np.uint8],
    prediction: NDArray[np.uint8],
    *,
    mask: NDArray[np.bool_] | None = None,
    classes: ClassSet = DEFAULT_CLASSES,
) -> dict[str, float]:
    """Score predicted class ids: grids (H, W) or (N, H, W), pooled -> IoU by class, category and merged category.

    Cells of `mask`, of the same shape, are left out.

    Raises:
        InputError: shapes differ, or an id is not that of a class.
    """
    shape = np.shape(target)
    left_out = np.zeros(shape, np.bool_) if mask is None else np.asarray(mask, np.bool_)
    if len(shape) < 2 or not shape == np.shape(prediction) == left_out.shape:
        raise InputError(f"shapes are {shape}, {np.shape(prediction)} and {left_out.shape}", field="score")
    for name, grid in (("target", target), ("prediction", prediction)):
        if np.size(grid) and not 0 <= np.min(grid) <= np.max(grid) < classes.count:
            raise InputError(f"has ids outside 0 to {classes.count - 1}", field=name)
    flat = (-1, *shape[-2:])
    seen, guessed = (np.asarray(grid, np.uint8).reshape(flat) for grid in (target, prediction))
    counts, iou = confusion(seen, guessed, left_out.reshape(flat), classes.count), iou_of(classes)
    return dict(zip(iou.labels, iou.figures(iou.ratios(counts.sum(axis=0))).tolist(), strict=True))


def make_windows(
    recordings: Sequence[GridRecording],
    config: WindowConfig | None = None,
    *,
    sensors: Sequence[str] = (),
    grid: GridConfig | None = None,
    translate: bool = True,
) -> WindowSet:
    """Take every window of some recordings: inputs of the past, in the target's place, and the target.

    Args:
        recordings: as `build_grids` makes them, all of one configuration.
        config: inputs, steps and horizon.
        sensors: names of the inputs' sensors; that of the target if not given.
        grid: by which the grids were made.
        translate: whether inputs are moved into the target's place.

    Raises:
        InputError: no recording is long enough, or there is no such sensor.
    """
    grid = grid or GridConfig()
    data = stack_recordings(recordings, cell_m=grid.spec.cell_m, classes=grid.classes)
    windows = training_windows(data.frame_counts, config or WindowConfig()).windows
    return select_windows(data, windows, sensors=sensors or [data.target], translate=translate)


def make_model(
    model: str | type[Model], windows: WindowSet, settings: Mapping[str, Any] | None = None, *, seed: int = 0
) -> Model:
    """Make a model for windows of this kind: a name like `fuse` or `ed`, `path.py:Class`, or a class.

    Code of one's own runs in this process here and in `fit`, as the caller's does; `run` has it in a process apart.

    Raises:
        InputError: there is no such model, or the settings are not its own.
    """
    made = registry.find_model(model) if isinstance(model, str) else model
    data, (rows, columns) = windows.data, windows.data.size
    given = Given(windows.sensors, windows.inputs.shape[1], rows, columns, data.cell_m, windows.translate, data.classes)
    chosen = made.parse_settings(dict(settings or {}), path="settings")
    made.check(chosen, given)
    return seeded_network(made, chosen, given, seed) if issubclass(made, Network) else made(chosen, given)


def fit(
    model: Model,
    windows: WindowSet,
    *,
    seed: int = 0,
    device: str = "auto",
    folder: Path | str | None = None,
    validation: WindowSet | None = None,
) -> Model:
    """Fit a model to training windows and return it; one that does not learn is returned as it is.

    Args:
        model: as `make_model` makes it.
        windows: to learn from.
        seed: of the order of windows and whatever else chance decides.
        device: `auto`, `cpu`, `cuda`, `cuda:1` ...
        folder: keeps a network's checkpoint, history and weights, so that the same call continues after a stop; take
            another folder when the code of a network of your own has changed.
        validation: windows whose loss is noted after each epoch.

    Raises:
        InputError: the folder belongs to another training or cannot be written to.
        DivergedError: the loss is no longer a number.
    """
    if not isinstance(model, Network):
        if model.learns():
            model.fit(windows)
        return model
    settle_process()
    with TemporaryDirectory() as temporary:
        place = Path(folder or temporary)
        return train(
            model, windows, seed=seed, device=choose_device(device), folder=place, validation=validation
        ).network


def run(
    matrix: str | Path,
    logs: Path | str,
    out: Path | str,
    *,
    device: str = "auto",
    jobs: int = 1,
    only: Sequence[str] = (),
    models: Sequence[str] = (),
    validation_logs: Path | str | None = None,
    own_models: Literal["apart", "here"] = "apart",
    time_limit_s: float = 3600.0,
    memory_limit_gib: float | None = None,
) -> RunRecord:
    """Train and score every row of a matrix file or preset; what is done already is kept.

    Args:
        matrix: a preset's name or a YAML file.
        logs: folder of logs.
        out: folder of the run, in which grids are kept, too.
        device: `auto`, `cpu`, `cuda`, `cuda:1` ...
        jobs: rows at once, each in a process of its own.
        only: names or patterns of rows, like `BL-*`; all if not given.
        models: one more row for each, like `mine.py:Mine`.
        validation_logs: folder of the logs to score, where they are not in `logs`.
        own_models: whether models of one's own run in processes apart or in this one, where a debugger can follow.
        time_limit_s: how long code of one's own, apart, may go without a sign: an update, a batch, the end of `fit`.
        memory_limit_gib: what it may use there, seven eighths of the machine's memory if not given.

    Raises:
        InputError: there is no log at all, or the device does not exist.
        ConfigError: the matrix is malformed; the message names file, row and key.
    """
    folder = Path(out)
    executor = local_executor(jobs)
    scored = None if validation_logs is None else Path(validation_logs)
    options = RunOptions(
        device, folder / "grids", "semgrid_eval.run", tuple(only), executor, executor, validation_logs=scored
    )
    limits = guest_limits(time_limit_s, memory_limit_gib) if own_models == "apart" else None
    with registry.own_models(limits):
        return run_matrix(load_matrix(str(matrix), models=models), Path(logs), folder, options)


def load_run(
    run: Path | str, *, metrics: Sequence[str] | None = None, partitions: Sequence[str] | None = None
) -> "DataFrame":
    """Return every figure of a run's folder: row, seed, metric, division, region, column, value, cells, windows.

    It has all metrics and partitions into regions, or those that are named.

    Raises:
        InputError: the run or a result of it cannot be read.
    """
    return load_figures(Path(run), metrics=metrics, partitions=partitions)


def write_report(
    run: Path | str | Sequence[Path | str],
    out: Path | str | None = None,
    *,
    resample: Literal["recordings", "groups"] = "recordings",
) -> Path:
    """Write the report of one run, or of several side by side, and return its page.

    Args:
        run: the folder of a run, or several.
        out: the folder to write; `report` in the (first) run if not given. A report there is replaced.
        resample: recordings, or towns, cities or drives first.

    Raises:
        InputError: a run's record cannot be read, or `out` holds something other than a report.
    """
    from semgrid_eval.report.page import write  # so that matplotlib is imported only for reports

    folders = [Path(run)] if isinstance(run, Path | str) else [Path(each) for each in run]
    return write.write_report(folders, None if out is None else Path(out), resample=resample)
