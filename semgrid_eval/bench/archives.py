"""Archives of a run that fit through narrow doors: unpacked in one folder, all of them together are the run again."""

import tarfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from semgrid_eval.models.checkpoint import WEIGHTS_FILE

LARGEST_BYTES = 15_000_000
"""Of the weights in one archive."""
_PARTS = ("run.json", "results", "windows")


def pack_run(run: Path, name: Path, *, weights: bool) -> None:
    """Pack record, results and windows of a run into `NAME-run.tar.gz`, if there is one; pictures are left out.

    `weights` of trainings that are finished go into `NAME-weights-0.tar.gz` and further ones.
    """
    if not run.is_dir():
        return
    _pack(run, [run / part for part in _PARTS if (run / part).exists()], f"{name}-run.tar.gz")
    finished = sorted(path.parent for path in (run / "trainings").glob(f"*/{WEIGHTS_FILE}"))
    for number, some in enumerate(_shared_out(finished) if weights else ()):
        _pack(run, some, f"{name}-weights-{number}.tar.gz")


def _pack(run: Path, paths: Iterable[Path], archive: str) -> None:
    with tarfile.open(archive, "w:gz") as packed:
        for path in paths:
            packed.add(path, path.relative_to(run.parent).as_posix())


def _shared_out(trainings: Sequence[Path]) -> list[list[Path]]:
    """Share out trainings in their order, so that the weights of a share stay below the limit."""
    shares, left = list[list[Path]](), 0
    for training in trainings:
        size = (training / WEIGHTS_FILE).stat().st_size
        if size > left:
            shares.append([])
            left = LARGEST_BYTES
        shares[-1].append(training)
        left -= size
    return shares
