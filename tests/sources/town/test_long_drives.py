"""Drives of any length: the town is there all the way, and what depends on a recording's length follows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.towns import small_plans

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.draws import Draws
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.types import Pose
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sources.town import rendering, stage
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.drives import FRAME_RATE_HZ, ego_path
from semgrid_eval.sources.town.rendering import render_recording
from semgrid_eval.sources.town.sensors import Camera, cityscapes_camera
from semgrid_eval.sources.town.town import load_town

FRAMES = 120
SENSORS = {"full": CameraSensor(image_size_px=(128, 64))}


@pytest.fixture(scope="module")
def plan():
    """The longest way of the drives that are planned."""
    return max(small_plans(frames=FRAMES), key=lambda plan: np.linalg.norm(np.subtract(*ends(plan))))


@pytest.fixture(scope="module")
def log(plan, tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "long.mcap"
    write_log(render_recording(plan), path)
    return path


def at(plan, frame):
    path = ego_path(load_town(plan.town).traffic, plan.drive)
    return path.at(plan.drive.start_s + frame / FRAME_RATE_HZ)[:3]


def ends(plan):
    return at(plan, 0)[:2], at(plan, plan.drive.frames - 1)[:2]


def test_a_recording_has_the_frames_that_were_asked_for(log):
    with LogReader(log) as reader:
        stamps_s = np.array([frame.stamp_ns for frame in reader.frames("front")]) * 1e-9
    assert len(stamps_s) == FRAMES
    assert np.diff(stamps_s).mean() == pytest.approx(1 / FRAME_RATE_HZ, abs=0.001)


def test_the_length_is_part_of_a_plan_and_leaves_those_of_thirty_frames_alone(plan):
    assert plan.description()["drive"]["frames"] == FRAMES
    usual = replace(plan, drive=replace(plan.drive, frames=30))
    assert "frames" not in usual.description()["drive"]
    assert usual.digest != plan.digest != replace(plan, drive=replace(plan.drive, frames=31)).digest


def test_the_town_is_as_whole_at_the_end_as_around_a_place_of_its_own(plan, monkeypatch):
    monkeypatch.setattr(stage, "_SIGHT_M", 60.0)
    start_m, end_m = ends(plan)
    assert math.dist(start_m, end_m) > 40.0
    town, camera = load_town(plan.town), Camera(cityscapes_camera(128, 64), 128, 64)
    path, time_s = ego_path(town.traffic, plan.drive), plan.drive.start_s + FRAMES / FRAME_RATE_HZ
    pose = Pose(0, *at(plan, FRAMES))
    passed = rendering._places(path, np.linspace(plan.drive.start_s, time_s, FRAMES))
    stages = [stage.Stage(town, places) for places in ([end_m], passed, [start_m])]
    others = stages[0].others(time_s, pose, plan.drive.actor)
    wanted, found, begun = (each.scenery(others, time_s, pose).seen_by(camera) for each in stages)
    near = wanted.depth_m < 19.0  # the last place is at most 40 m behind
    assert (found.label == wanted.label)[near].all()
    assert not (begun.label == wanted.label)[wanted.depth_m < 58.0].all()  # what was there at first does not suffice
    assert set(stages[2].parked.actor) < set(stages[1].parked.actor)


def test_grids_keep_the_whole_drive_in_one_piece(log):
    whole = build_log(log, GridConfig(sensors=SENSORS, stretch_frames=1000))
    assert [len(part.stamps_ns) for part in whole] == [FRAMES]
    assert whole[0].actors is not None
    cut = build_log(log, GridConfig(sensors=SENSORS))
    assert [len(part.stamps_ns) for part in cut] == [30] * (FRAMES // 30)


def test_errors_late_in_a_drive_can_be_drawn_again(log):
    config = GridConfig(sensors=SENSORS, stretch_frames=1000)
    (recording,) = build_log(log, config)
    stamps = recording.stamps_ns
    times = WindowTimes(stamps[[0]], stamps[[[FRAMES - 11, FRAMES - 6]]], stamps[[FRAMES - 1]])
    with LogReader(log) as reader:
        votes = Draws(3, continued=True).find(reader, config, times)[0]
    likely = votes.argmax(axis=0)
    grid = recording.grids[0, -1]
    known = (grid != 0) & (likely != 0)
    assert known.sum() > 100
    assert (likely == grid)[known].mean() > 0.8


def test_a_drive_must_fit_into_the_simulated_time():
    values = {"recordings": 2, "duration_s": 20.0}
    assert parse_config(SyntheticConfig, {**values, "frames": 200}).frames == 200
    with pytest.raises(ConfigError, match="a drive of 340 frames needs a town of 24 s or more, not 20 s"):
        parse_config(SyntheticConfig, {**values, "frames": 340})
    with pytest.raises(ConfigError, match="frames"):
        parse_config(SyntheticConfig, {**values, "frames": 1})
