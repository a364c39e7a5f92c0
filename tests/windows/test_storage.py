"""Where cells lie: read when asked for, of the sensors asked for, into a file without a name that is mapped."""

import errno
import os
import pickle
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from support.mapped import NEEDS_PROC, file_of
from support.recordings import random_recording

from semgrid_eval.errors import InputError
from semgrid_eval.grids import recording as kept
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows
from semgrid_eval.windows.storage import Storage

SENSORS = ("full", "upper", "lower")
CPU = torch.device("cpu")


@pytest.fixture
def recordings():
    return [random_recording(seed, sensors=SENSORS, truth=seed != 1) for seed in range(3)]


@pytest.fixture
def on_disk(recordings, tmp_path):
    """The same recordings in files."""
    found = []
    for each in recordings:
        path = tmp_path / f"{each.name}.npz"
        kept.write_recordings(path, [each], owner=each.digest)
        found += kept.find_recordings(path, Path(each.log), owner=each.digest)
    return found


@pytest.fixture
def reads(monkeypatch):
    """Names of the arrays that are read from files, as they are read."""
    names, read = [], kept.read_arrays

    def noted(path, wanted, **given):
        names.extend((path.stem, name) for name in wanted)
        return read(path, wanted, **given)

    monkeypatch.setattr(kept, "read_arrays", noted)
    return names


def windows_of(data, sensors=("lower",)):
    return select_windows(data, training_windows(data.frame_counts, WindowConfig()).windows, sensors=sensors)


def test_what_is_not_asked_for_is_never_read(on_disk, reads, tmp_path):
    data = stack_recordings(on_disk, cell_m=0.5, sensors=["lower"], storage=Storage(CPU, tmp_path / "cache"))
    windows = windows_of(data)
    assert windows.digest()
    assert reads == [], "planning needs no cells"
    for _ in range(2):
        windows.batch(slice(0, 4))
    assert sorted(reads) == [(f"random {seed}", f"grids.0.{name}") for seed in range(3) for name in ("full", "lower")]
    reads.clear()
    for _ in range(2):
        windows.actors(slice(0, 4))
    assert reads == [("random 0", "actors.0")], "flags of recordings with a target that is scored, and once"


@pytest.mark.parametrize("folder", [None, "cache"])
def test_how_far_grids_are_gathered_is_shown_when_they_are_asked_for(on_disk, tmp_path, folder):
    said = []

    @contextmanager
    def stage(label):
        yield lambda done, total, message="": said.append((label, done, total, message))

    storage = Storage(CPU, folder and tmp_path / folder, stage)
    data = stack_recordings(on_disk, cell_m=0.5, storage=storage)
    assert said == []
    for _ in range(2):
        assert data.grids.shape[0] == len(SENSORS)
    assert said == [("gather", done, 3, f"random {done - 1}") for done in (1, 2, 3)]


@NEEDS_PROC
def test_grids_lie_in_a_file_that_has_no_name(on_disk, recordings, tmp_path):
    folder = tmp_path / "cache"
    mapped = stack_recordings(on_disk, cell_m=0.5, storage=Storage(CPU, folder))
    held = stack_recordings(recordings, cell_m=0.5)
    assert torch.equal(mapped.grids, held.grids)
    assert file_of(mapped.grids).startswith(str(folder))
    assert file_of(held.grids) == ""
    assert list(folder.iterdir()) == []


def test_windows_are_the_same_wherever_their_grids_lie(on_disk, recordings, tmp_path):
    mapped = windows_of(stack_recordings(on_disk, cell_m=0.5, storage=Storage(CPU, tmp_path / "cache")))
    held = windows_of(stack_recordings(recordings, cell_m=0.5))
    assert mapped.digest() == held.digest()
    one, other = (windows.batch(torch.arange(0, len(held), 7)) for windows in (mapped, held))
    for name in ("past", "shift_cells", "lead_s", "target", "mask"):
        assert torch.equal(getattr(one, name), getattr(other, name)), name
    assert (mapped.actors(slice(None)) == held.actors(slice(None))).all()


@NEEDS_PROC
def test_another_process_is_sent_the_place_of_the_file(on_disk, tmp_path):
    data = stack_recordings(on_disk, cell_m=0.5, storage=Storage(CPU, tmp_path / "cache"))
    content = pickle.dumps(replace(data, actors=None))
    assert len(content) < data.grids.nbytes / 4
    there = pickle.loads(content)
    assert torch.equal(there.grids, data.grids)
    assert file_of(there.grids) == file_of(data.grids)


def test_a_full_disk_is_said_in_one_line(on_disk, tmp_path, monkeypatch):
    def fails(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", fails, raising=False)
    data = stack_recordings(on_disk, cell_m=0.5, storage=Storage(CPU, tmp_path / "cache"))
    with pytest.raises(InputError, match=r"cache: cannot be written: No space left on device; 0\.0 GiB are needed"):
        windows_of(data).batch(slice(0, 1))


def test_grids_that_are_gone_are_named(on_disk, tmp_path):
    (tmp_path / "random 1.npz").unlink()
    data = stack_recordings(on_disk, cell_m=0.5, storage=Storage(CPU, tmp_path / "cache"))
    with pytest.raises(InputError, match=r"random 1\.npz: cannot be read: No such file"):
        windows_of(data).batch(slice(0, 1))
