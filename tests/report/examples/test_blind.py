import dataclasses

import cv2
import numpy as np
import pytest
from support.toy_world import street

from semgrid_eval.arrays import read_arrays
from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.thumbnails import RunThumbnails, blind_cells
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.results import WindowRecord, windows_file
from semgrid_eval.scores.thumbnails import Track
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.projection import unit_projection

GROUND = [CLASS_NAMES.index(name) for name in ("road", "sidewalk")]
SPLIT = ("split2_upper", "split2_lower")
NOW_NS = 2_000
WINDOW = WindowRecord(
    recording="toy", log="toy.mcap", target_frame=2, target_stamp_ns=NOW_NS, input_stamps_ns=(0, 1_000)
)


def track(*poses):
    """A track whose camera is that of the toy streets; it stands still unless poses are given."""
    known = np.array(poses or [(0.0, 0.0, 0.0)] * 3)
    projection = unit_projection(street().calibration(), (256, 128))
    return Track(0, np.arange(len(known)) * 1_000, known, projection)


def shrunk(flags, cells):
    return cv2.erode(flags.astype(np.uint8), np.ones((2 * cells + 1, 2 * cells + 1), np.uint8)) > 0


@pytest.mark.parametrize("place", [0, 1], ids=["turning", "straight"])
def test_ground_in_blind_cells_is_in_no_input_but_in_the_target(seen, place):
    (run,) = load_runs([seen])
    row = next(row for row in run.rows if row.name == "own-Sp2")
    window = row.shown.record.windows[place]
    arrays = read_arrays(windows_file(seen, row.shown.record.windows_id), ("inputs", "target"))
    known = RunThumbnails(run).of(window.log, row.shown)
    blind = blind_cells(known.track, GridConfig(), SPLIT, window)
    inside = shrunk(blind, 2)  # cells at the edge are partly seen, and morphology spreads them
    inputs, target = np.isin(arrays["inputs"][place], GROUND).any(axis=(0, 1)), np.isin(arrays["target"][place], GROUND)
    assert (inputs & ~blind).sum() > 100
    assert (target & inside).sum() > 200
    assert (inputs & inside).sum() < 0.01 * (target & inside).sum()


def test_a_far_wide_band_and_both_margins_are_blind_on_a_standing_vehicle():
    blind = blind_cells(track(), GridConfig(), SPLIT, WINDOW)
    ahead = np.flatnonzero(blind[:, 64])  # straight ahead
    assert (np.diff(ahead) == 1).all()
    # rows 125 to 145 of 256, the camera 1.22 m up and tilted by 0.038: by hand 16.9 to 35.2 m, 1.7 m more from the axle
    nearest_m, farthest_m = (128 - ahead[[-1, 0]] - 0.5) * 100 / 128
    assert nearest_m == pytest.approx(1.7 + 1.22 / np.tan(0.038 + (145 / 2 - 0.5 - 63.8) / 283.1), abs=0.8)
    assert farthest_m == pytest.approx(1.7 + 1.22 / np.tan(0.038 + (125 / 2 - 0.5 - 63.8) / 283.1), abs=0.8)
    row = 20  # far ahead, only the margins of the image are in no sensor
    parts = np.flatnonzero(np.diff(np.concatenate([[0], blind[row].astype(int), [0]])) == 1)
    assert len(parts) == 2


def test_sensors_that_share_the_image_leave_nothing_blind():
    assert not blind_cells(track(), GridConfig(), ("split1_upper", "split1_lower"), WINDOW).any()


def test_driving_on_moves_the_band_nearer_by_the_way_driven():
    standing = blind_cells(track(), GridConfig(), SPLIT, WINDOW)
    way_m = 10 * 100 / 128  # ten cells between the inputs, which are seen from one place, and the target
    moved = blind_cells(track((0, 0, 0), (0, 0, 0), (way_m, 0, 0)), GridConfig(), SPLIT, WINDOW)
    np.testing.assert_array_equal(moved[10:], standing[:-10])


def test_grids_keep_the_orientation_of_their_first_frame():
    turned = [(0.0, 0.0, 0.1), (0.0, 0.0, 0.1), (0.0, 0.0, 0.1)]
    straight = blind_cells(track(), GridConfig(), SPLIT, WINDOW)
    np.testing.assert_array_equal(blind_cells(track(*turned), GridConfig(), SPLIT, WINDOW), straight)
    later = blind_cells(track((0.0, 0.0, 0.0), *turned[1:]), GridConfig(), SPLIT, WINDOW)
    # Row 60 is 53 m ahead, where a turn of 0.1 to the left is 6.8 cells, and a little more at the margins of the image.
    assert -10 < centre_column(later[60]) - centre_column(straight[60]) < -6


def centre_column(flags):
    return float((np.arange(len(flags)) * flags).sum() / flags.sum())


def test_for_other_times_or_unknown_sensors_nothing_is_said():
    assert blind_cells(track(), GridConfig(), SPLIT, WINDOW.model_copy(update={"input_stamps_ns": (7,)})) is None
    assert blind_cells(track(), GridConfig(), SPLIT, WINDOW.model_copy(update={"target_stamp_ns": 7})) is None
    assert blind_cells(track(), GridConfig(), ("gone",), WINDOW) is None


def test_a_camera_that_looks_back_sees_nothing_ahead():
    known = track()
    back = dataclasses.replace(known, projection=-known.projection)
    crops = {"full": CameraSensor(), "small": CameraSensor(bottom_px=10, right_px=10)}
    assert not blind_cells(back, GridConfig(sensors=crops), ("small",), WINDOW).any()


def test_nothing_is_said_of_what_another_camera_sees():
    lower = CameraSensor(camera="front", top_px=145)
    sensors = {"full": CameraSensor(camera="front"), "lower": lower, "left": CameraSensor(camera="left")}
    grid = GridConfig(sensors=sensors)
    assert blind_cells(track(), grid, ("lower",), WINDOW).any()
    assert blind_cells(track(), grid, ("lower", "left"), WINDOW) is None
