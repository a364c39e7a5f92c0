"""A row's predictions as logs that `model: log`, or any other reader of the message, takes."""

from collections.abc import Iterator
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_folder
from semgrid_eval.grids.extent import extent_of
from semgrid_eval.log.predictions import Prediction, write_predictions
from semgrid_eval.log.store import SUFFIX
from semgrid_eval.playback.scored import Scored, find_row, read_scored
from semgrid_eval.scores import results

_NS_PER_MS = 1_000_000


def export_row(run: Path, row_name: str, out: Path, *, latency_ms: float = 0.0) -> list[Path]:
    """Write what a row predicted for its windows as a folder of logs, one for each recording; return their paths.

    Args:
        run: folder of the run.
        row_name: a row that is not a stream, whose predictions are kept.
        out: the folder to write; it must not exist, or be empty.
        latency_ms: from the capture of the newest input to what is written as the publication.

    Raises:
        InputError: the row does not exist or has no predictions, or `out` holds something.
    """
    if latency_ms < 0:
        raise InputError(f"{latency_ms:g} ms is negative", field="latency_ms")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("exists and is not an empty folder", path=out)
    scored = read_scored(run, find_row(results.read_run(run), row_name, run))
    extent, took_ns = extent_of(scored.grid.spec), round(latency_ms * _NS_PER_MS)
    with atomic_folder(out) as partial:
        for name in scored.windows_of:
            write_predictions(partial / f"{name}{SUFFIX}", _predictions(scored, name, took_ns), name, extent)
    return [out / f"{name}{SUFFIX}" for name in scored.windows_of]


def _predictions(scored: Scored, name: str, took_ns: int) -> Iterator[Prediction]:
    windows = scored.record.windows
    places = sorted(scored.windows_of[name], key=lambda place: windows[place].input_stamps_ns[-1])
    for place in places:
        capture_ns = windows[place].input_stamps_ns[-1]
        classes, certainty = (scored.arrays[each][place] for each in ("prediction", "certainty"))
        yield Prediction(classes, windows[place].target_stamp_ns, capture_ns, capture_ns + took_ns, certainty)
