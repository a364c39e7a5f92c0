"""Changes bytes of whatever a run keeps, and counts what readers take for whole all the same."""

import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import torch
import yaml
from support.drawn_again import write_town_like
from support.small_runs import TINY, WINDOW

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess
from semgrid_eval.grids.recording import find_recordings
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import read_answer
from semgrid_eval.models.checkpoint import read_header, read_history
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.packed import PackedGrids, pack_grids
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import check_sums
from semgrid_eval.scores.thumbnails import read_pictures
from semgrid_eval.seals import read_sealed
from semgrid_eval.windows.storage import Storage

ROWS = [
    {"name": "BL-DC", "model": "newest"},
    {"name": "BL-Fuse", "model": "fuse", "window": {"step_frames": 2}},
    {"name": "ED-DC", "model": "ed", "repeats": 2},
]
KINDS: dict[str, tuple[str, Callable[[Path, str], object]]] = {
    "run record": ("run.json", lambda path, _: results.read_run(path.parent)),
    "result": ("results/*/result.json", lambda path, _: results.read_result(path.parent)),
    "sums": ("results/*/sums.npz", lambda path, _: check_sums(path.parent, 2)),
    "expected": ("results/*/expected.npz", lambda path, _: check_sums(path.parent, 2, has_expected=True)),
    "predictions": ("results/*/predictions.npz", lambda path, _: results.read_predictions(path.parent)),
    "history": ("results/*/history.csv", lambda path, _: results.read_history(path.parent)),
    "windows": ("windows/*.npz", lambda path, _: results.read_windows(path.parent.parent, path.stem)),
    "thumbnails": ("pictures/*.npz", lambda path, _: read_pictures(path)),
    "grids": ("grids/toy?-[0-9a-f]*.npz", lambda path, _: find_recordings(path, Path("log"), owner=_key(path))),
    "truth": ("grids/*-truth-*.npz", lambda path, _: read_answer(path, _key(path))),
    "packed grids": ("packed/*/*.npz", lambda path, _: _packed(path.parents[1]).data(GridConfig(), path.parent.name)),
    "packed index": ("packed/packed.json", lambda path, _: _packed(path.parent)),
    "weights": ("trainings/*/weights.safetensors", lambda path, owner: read_header(path, owner=owner)),
    "losses": ("trainings/*/history.csv", lambda path, owner: read_history(path, owner=owner)),
    "checkpoint": ("trainings/*/checkpoint.pt", lambda path, owner: read_sealed(path, owner)),
}
"""Where each kind of file lies below a run, and what reads it, given whose seal it has."""


def _key(path: Path) -> str:
    """The digest in a file's name, of all that decides what it holds."""
    return path.stem.rpartition("-")[2]


def _packed(folder: Path) -> PackedGrids:
    return PackedGrids(folder, load_matrix(str(folder.parent.parent / "m.yaml")).rows, Storage(torch.device("cpu")))


def make_run(folder: Path) -> Path:
    """Run a small matrix that leaves a file of each kind."""
    logs, out, file = write_town_like(folder / "logs"), folder / "run", folder / "m.yaml"
    defaults = {"window": WINDOW, "second_target": "expected"}
    file.write_text(yaml.safe_dump({"seed": 5, "models": TINY, "defaults": defaults, "rows": ROWS}))
    matrix = load_matrix(str(file))
    unlink = Path.unlink
    Path.unlink = lambda path, **given: None if path.suffix == ".pt" else unlink(path, **given)  # keeps checkpoints
    try:
        run_matrix(matrix, logs, out, RunOptions("cpu", out / "grids", "test"))
    finally:
        Path.unlink = unlink
    cpu = torch.device("cpu")
    data = RunData(logs, out / "grids", matrix.rows, executor=InProcess(), device=cpu, stage=silent_stage)
    pack_grids(data, GridConfig(), out / "packed")
    return out


def changed(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """Change content in one of several ways: bits, stretches, its end, or all of it for another file of its kind."""
    kind = chance.choice(("bit", "bit", "bits", "stretch", "cut", "more", "swap"))
    if kind == "swap" and others:
        return chance.choice(others)
    if kind == "cut":
        return content[: chance.randrange(len(content))]
    if kind == "more":
        return content + chance.randbytes(chance.randint(1, 64))
    data = bytearray(content)
    if kind == "stretch":
        at = chance.randrange(len(data))
        data[at : at + 64] = chance.randbytes(len(data[at : at + 64]))
    for _ in range({"bits": 8, "stretch": 0}.get(kind, 1)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(data)


def mutate(run: Path, kind: str, count: int, chance: random.Random) -> Iterator[bool]:
    """Change files of a kind so many times, and tell of each time whether it was accepted; they end as they were."""
    pattern, read = KINDS[kind]
    paths = sorted(run.glob(pattern))
    whole = {path: path.read_bytes() for path in paths}
    for _ in range(count):
        path = chance.choice(paths)
        others = [content for other, content in whole.items() if content != whole[path]]
        data = changed(whole[path], others, chance)
        if data == whole[path]:
            continue
        owner = re.findall(rb"semgrid-eval seal (\S+) ", whole[path])[-1].decode()
        path.write_bytes(data)
        try:
            read(path, owner)
        except InputError:
            yield False
        else:
            yield True
        finally:
            path.write_bytes(whole[path])
