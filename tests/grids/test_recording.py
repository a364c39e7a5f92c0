from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.recordings import random_recording

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import ResultError
from semgrid_eval.grids.recording import RecordingGrids, find_recordings, write_recordings


def stretches():
    """Stretches of unequal lengths, the second without the truth."""
    shared = {"digest": "d", "log": "here.mcap", "group": "town 3", "target": "low"}
    recordings = [random_recording(i, frames=3 + i, size=8, sensors=("up", "low"), truth=i != 1) for i in range(3)]
    return [replace(recording, **shared) for recording in recordings]


def test_stretches_come_back_as_they_were(tmp_path):
    written = stretches()
    write_recordings(tmp_path / "kept.npz", written, owner="d")
    found = find_recordings(tmp_path / "kept.npz", Path("here.mcap"), owner="d")
    assert len(found) == 3
    for one, same in zip(written, found, strict=True):
        for name in (*RecordingGrids.__dataclass_fields__, "size", "has_truth"):
            np.testing.assert_array_equal(getattr(one, name), getattr(same, name), err_msg=name)
        for sensor in one.sensors:
            np.testing.assert_array_equal(one.cells(sensor), same.cells(sensor))
        if one.has_truth:
            np.testing.assert_array_equal(one.flags(), same.flags())
    assert [recording.has_truth for recording in found] == [True, False, True]


def test_a_file_that_lacks_an_array_is_refused(tmp_path):
    write_recordings(tmp_path / "kept.npz", stretches(), owner="d")
    arrays = read_arrays(tmp_path / "kept.npz", ("log", "sensors", "names", "frames", "stamps_ns"))
    write_arrays(tmp_path / "kept.npz", arrays, owner="d")
    with pytest.raises(ResultError, match="has no array has_checksums"):
        find_recordings(tmp_path / "kept.npz", Path("here.mcap"), owner="d")


def test_a_file_of_another_owner_is_refused(tmp_path):
    write_recordings(tmp_path / "kept.npz", stretches(), owner="e")
    with pytest.raises(ResultError, match=r"kept\.npz: belongs to another id \(e, not d\)"):
        find_recordings(tmp_path / "kept.npz", Path("here.mcap"), owner="d")
