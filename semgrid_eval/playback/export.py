"""Logs of predictions as `model: log` takes them: of a model of one's own, or of a row of a run."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_folder
from semgrid_eval.grids.extent import extent_of
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log import predictions as logs
from semgrid_eval.log.predictions import Prediction
from semgrid_eval.log.store import SUFFIX
from semgrid_eval.playback.scored import Scored, find_row, read_scored
from semgrid_eval.scores import results

_NS_PER_MS = 1_000_000


def write_predictions(
    path: Path | str,
    predictions: Iterable[Prediction],
    *,
    recording: str,
    spec: GridSpec | None = None,
    classes: ClassSet = DEFAULT_CLASSES,
) -> int:
    """Write what a model of one's own predicted as a log for rows of `model: log`, and return how many there were.

    Args:
        path: the log to write, one for each recording.
        predictions: in the order of their publication; they are written as they come.
        recording: name of the recording, as `build_grids` and results have it.
        spec: extent of the grids.
        classes: of their cells.

    Raises:
        InputError: there is none, or one is of another size, has ids that are not classes or times that cannot be.
    """
    return logs.write_predictions(Path(path), predictions, recording, extent_of(spec or GridSpec(), classes))


def export_predictions(run: Path | str, row: str, out: Path | str, *, latency_ms: float = 0.0) -> list[Path]:
    """Write what a row predicted for its windows as a folder of such logs, one a recording, and return their paths.

    Args:
        run: folder of the run.
        row: a row that is not a stream, whose predictions are kept.
        out: the folder to write; it must not exist, or be empty.
        latency_ms: from the capture of the newest input to what is written as the publication.

    Raises:
        InputError: the row does not exist or has no predictions, or `out` holds something.
    """
    run, out = Path(run), Path(out)
    if not 0 <= latency_ms < float("inf"):
        raise InputError(f"{latency_ms:g} ms is not a latency", field="latency_ms")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("exists and is not an empty folder", path=out)
    scored = read_scored(run, find_row(results.read_run(run), row, run))
    took_ns, names = round(latency_ms * _NS_PER_MS), list(scored.windows_of)
    extent = extent_of(scored.grid.spec, scored.grid.classes)
    with atomic_folder(out) as partial:
        for name in names:
            found = _predictions(scored, name, took_ns)
            logs.write_predictions(partial / f"{name}{SUFFIX}", found, name, extent)
    return [out / f"{name}{SUFFIX}" for name in names]


def _predictions(scored: Scored, name: str, took_ns: int) -> Iterator[Prediction]:
    windows = scored.record.windows
    for place in sorted(scored.windows_of[name], key=lambda place: windows[place].input_stamps_ns[-1]):
        capture_ns = windows[place].input_stamps_ns[-1]
        classes, certainty = (scored.arrays[each][place] for each in ("prediction", "certainty"))
        yield Prediction(classes, windows[place].target_stamp_ns, capture_ns, capture_ns + took_ns, certainty)
