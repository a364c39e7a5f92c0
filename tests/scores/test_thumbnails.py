import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import ResultError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.scores.thumbnails import (
    FramePictures,
    LogPictures,
    Track,
    pictures_file,
    read_faults,
    read_pictures,
    read_track,
    write_pictures,
)
from semgrid_eval.sensors.camera import CameraSensor

TRACK = Track(-7, np.array([1, 2]), np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]), np.arange(12.0).reshape(3, 4))
FRAMES = {5: FramePictures(b"five", b"labels"), -3: FramePictures(), 9: FramePictures(label=b"nine")}
PICTURES = LogPictures(TRACK, FRAMES, ("toy: /image at 5 ns is damaged",))
NAMES = (
    "stamps_ns",
    "images",
    "image_ends",
    "labels",
    "label_ends",
    "start_ns",
    "track_ns",
    "track",
    "projection",
    "faults",
)


@settings(max_examples=30)
@given(st.dictionaries(st.integers(-(2**63), 2**63 - 1), st.builds(FramePictures, st.binary(), st.binary())))
def test_what_is_written_is_read(tmp_path_factory, pictures):
    path = tmp_path_factory.mktemp("kept") / "pictures.npz"
    write_pictures(path, LogPictures(TRACK, pictures, PICTURES.faults))
    found = read_pictures(path)
    assert found.frames == pictures
    assert found.faults == read_faults(path) == PICTURES.faults
    for name, value in vars(TRACK).items():
        np.testing.assert_array_equal(getattr(found.track, name), value)


def test_equal_pictures_give_equal_bytes_whatever_their_order(tmp_path):
    write_pictures(tmp_path / "a" / "key", PICTURES)
    write_pictures(tmp_path / "b" / "key", LogPictures(TRACK, dict(reversed(FRAMES.items())), PICTURES.faults))
    assert (tmp_path / "a" / "key").read_bytes() == (tmp_path / "b" / "key").read_bytes()


def of(camera, **changes):
    return GridConfig(sensors={"full": CameraSensor(camera=camera)}, **changes)


def test_logs_cameras_and_integrators_have_files_of_their_own(tmp_path):
    grids = [of(None), of("front"), of("rear"), of(None, integrator="arc")]
    files = [pictures_file(tmp_path, log, grid) for log in ("one", "two") for grid in grids]
    assert len(set(files)) == 8
    assert {file.parent for file in files} == {tmp_path / "pictures"}
    assert pictures_file(tmp_path, "one", of(None, morphology="off")) == files[0]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("image_ends", np.array([0, 9, 4]), "images: is not one file after the other"),
        ("image_ends", np.array([0, 4, 5]), "images: is not one file after the other"),
        ("image_ends", np.array([-1, 4, 4]), "images: is not one file after the other"),
        ("image_ends", np.array([0.0, 4.0, 4.0]), "image_ends: has shape (3,), type float64"),
        ("labels", np.zeros((2, 5), np.uint8), "labels: has shape (2, 5), type uint8"),
        ("labels", np.zeros(10, np.int16), "labels: has shape (10,), type int16"),
        ("track", np.zeros((3, 3)), "track: has shape (3, 3), type float64"),
        ("track", np.full((2, 3), np.nan), "track: has shape (2, 3), type float64, or is not finite"),
        ("projection", np.zeros((3, 3)), "projection: has shape (3, 3)"),
        ("start_ns", np.array([1, 2]), "start_ns: has shape (2,), type int64"),
        ("stamps_ns", np.array([1, 2]), "frames: 2, images: 3, labels: 3"),
        ("faults", np.array([1]), "faults: has shape (1,), type int64"),
        ("stamps_ns", np.array([[1, 2, 3]]), "stamps_ns: has shape (1, 3), type int64"),
    ],
)
def test_files_that_contradict_themselves_are_refused(tmp_path, name, value, message):
    write_pictures(tmp_path / "kept", PICTURES)
    arrays = read_arrays(tmp_path / "kept", NAMES)
    write_arrays(tmp_path / "kept", {**arrays, name: value}, owner="kept")
    with pytest.raises(ResultError, match=re.escape(message)):
        read_pictures(tmp_path / "kept")


def test_the_track_can_be_read_alone(tmp_path):
    write_pictures(tmp_path / "kept", PICTURES)
    alone = read_track(tmp_path / "kept")
    assert alone.start_ns == PICTURES.track.start_ns
    for name in ("stamps_ns", "poses", "projection"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(PICTURES.track, name))
    with pytest.raises(ResultError, match="cannot be read"):
        read_track(tmp_path / "none")


def test_a_missing_or_damaged_file_is_told(tmp_path):
    with pytest.raises(ResultError, match="cannot be read"):
        read_pictures(tmp_path / "none")
    write_pictures(tmp_path / "kept", PICTURES)
    (tmp_path / "kept").write_bytes((tmp_path / "kept").read_bytes()[:80])
    with pytest.raises(ResultError, match="is damaged"):
        read_pictures(tmp_path / "kept")
    write_pictures(tmp_path / "kept", PICTURES)
    (tmp_path / "kept").rename(tmp_path / "another")
    with pytest.raises(ResultError, match=r"belongs to another id \(kept, not another\)"):
        read_faults(tmp_path / "another")
