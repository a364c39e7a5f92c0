"""The sensors of a simulated vehicle: one world by clocks of their own, each the same whatever is beside it."""

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from support.towns import small_plans

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.log.sweeps import sweep_message
from semgrid_eval.recording.disparity import coded_disparity, decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import Pose
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import LidarSensor
from semgrid_eval.sensors.projection import Projection
from semgrid_eval.sources.redrawing import Pictures, redrawing_of
from semgrid_eval.sources.town.drives import ego_path
from semgrid_eval.sources.town.ground import Ground, Surface
from semgrid_eval.sources.town.picture_errors import LIDAR, error_stream
from semgrid_eval.sources.town.rendering import render_recording
from semgrid_eval.sources.town.rig import CLOCKS, RIGS, SIDES, STAMP_JITTER_S, Clock, conditions_of
from semgrid_eval.sources.town.sensors import Camera, RayCaster
from semgrid_eval.sources.town.solids import BOX, Texture, box, soup_of_boxes
from semgrid_eval.sources.town.stage import Scenery
from semgrid_eval.sources.town.town import load_town
from semgrid_eval.sources.town.varied import fixed_conditions

pytestmark = pytest.mark.slow

CAMERAS = ("front", *SIDES)
STATIC = [CLASS_NAMES.index(name) for name in ("road", "sidewalk", "building", "vegetation", "pole_sign")]
MOMENTS = 32  # in .6 s
SPEC = GridSpec(rows=256, columns=256, cell_m=0.4, agent_row=128, agent_column=128)


def fastest_plan(**changes):
    def travelled_m(plan) -> float:
        path, start_s = ego_path(load_town(plan.town).traffic, plan.drive), plan.drive.start_s
        return float(np.linalg.norm(np.subtract(path.at(start_s + 0.6)[:2], path.at(start_s)[:2])))

    plan = max(small_plans(recordings=8), key=travelled_m)
    assert travelled_m(plan) > 3.0
    return replace(plan, rig="surround+lidar", **changes)


@pytest.fixture(scope="module")
def exact():
    """The first moments of a drive, all that is measured exact."""
    moments = render_recording(fastest_plan(stereo="exact", width_px=256, height_px=128)).moments()
    return list(islice(moments, MOMENTS))


@pytest.fixture(scope="module")
def measured():
    """The first moments of a drive with errors."""
    return list(islice(render_recording(fastest_plan()).moments(), MOMENTS))


def written(moments, folder, **changes):
    path = folder / "town.mcap"
    recording = render_recording(fastest_plan(stereo="exact", width_px=256, height_px=128, **changes))
    write_log(replace(recording, moments=lambda: iter(moments)), path)
    return path


def built(moments, folder):
    sensors = {name: CameraSensor(camera=name, image_size_px=(256, 128)) for name in CAMERAS} | {LIDAR: LidarSensor()}
    config = GridConfig(spec=SPEC, sensors=sensors, target=("front",), integrator="arc", morphology="off")
    (recording,) = build_log(written(moments, folder), config)
    return recording


def agreement(recording, one: str, other: str) -> tuple[float, int]:
    """Share of equal classes where both sensors know something static, over all frames, and the count of such cells."""
    first, second = (recording.grids[recording.sensors.index(name), 3:] for name in (one, other))
    both = np.isin(first, STATIC) & np.isin(second, STATIC)
    return float((first == second)[both].mean()), int(both.sum())


@pytest.fixture(scope="module")
def grids(exact, tmp_path_factory):
    return built(exact, tmp_path_factory.mktemp("exact"))


@pytest.mark.parametrize(("camera", "least"), [("front", 0.94), ("left", 0.8), ("right", 0.85), ("rear", 0.9)])
def test_cameras_and_lidar_of_an_exact_world_agree_on_what_stands_still(grids, camera, least):
    share, cells = agreement(grids, camera, LIDAR)
    assert cells > 500
    assert share > least


def test_a_side_camera_agrees_with_the_front_one_where_they_overlap(grids):
    share, cells = agreement(grids, "front", "left")
    assert cells > 200
    assert share > 0.85


def test_without_the_motion_between_their_clocks_they_agree_less(exact, grids, tmp_path):
    still = [replace(m, motion=tuple(replace(s, speed_mps=0.0, yaw_rate_radps=0.0) for s in m.motion)) for m in exact]
    unmoved = built(still, tmp_path)
    moved, not_moved = ([agreement(each, camera, LIDAR)[0] for camera in CAMERAS] for each in (grids, unmoved))
    assert sum(moved) > sum(not_moved) + 0.02


@pytest.mark.parametrize("camera", CAMERAS)
def test_each_camera_sees_the_walls_of_a_room_where_they_are(camera):
    near, far = 12.0, 1.0
    walls = [
        ((x_m, y_m, 0.0), (far, 26.0) if x_m else (26.0, far))
        for x_m, y_m in ((12.5, 0), (-12.5, 0), (0, 12.5), (0, -12.5))
    ]
    look = (LABEL_ID["building"], int(Texture.PLAIN), (90, 90, 90))
    soup = soup_of_boxes(np.array([box(place, (0.0, 20.0), size, look) for place, size in walls], BOX))
    ground = Ground(np.full((200, 200), Surface.ROAD, np.uint8), -20.0, -20.0)
    pose = Pose(0, 0.0, 0.0, 0.0)
    scenery = Scenery(pose, soup, soup, (RayCaster(soup.triangles_m),), ground, (0.0, 0.0))
    calibration = conditions_of(camera, fixed_conditions(256, 128)).calibration
    eye = Camera(calibration, 256, 128)
    view = scenery.seen_by(eye)
    disparity = coded_disparity(eye.disparity_px(view.depth_m).reshape(128, 256))
    pixels = Projection(calibration, (256, 128), DEFAULT_CLASSES.class_by_label()).points(
        disparity, view.label.reshape(128, 256)
    )
    is_wall = pixels.class_id == CLASS_NAMES.index("building")
    away_m = np.maximum(np.abs(pixels.forward_m), np.abs(pixels.left_m))
    assert is_wall.sum() > 5000
    np.testing.assert_allclose(away_m[is_wall], near, atol=0.1)
    assert (away_m[pixels.class_id == CLASS_NAMES.index("road")] < near + 0.1).all()
    bearing_rad = np.arctan2(pixels.left_m[is_wall], pixels.forward_m[is_wall])
    middle = math.remainder(float(np.angle(np.exp(1j * bearing_rad).mean())) - calibration.yaw_rad, math.tau)
    assert abs(middle) < 0.15, "it looks to its side"


def stamps_ns(moments, sensor):
    return np.array([each.stamp_ns for each in moments if sensor in each.cameras or sensor in each.sweeps])


@pytest.mark.parametrize("sensor", CLOCKS)
def test_each_sensor_has_a_clock_of_its_own_within_the_time_of_the_front_camera(measured, sensor):
    front, own = stamps_ns(measured, "front"), stamps_ns(measured, sensor)
    clock = CLOCKS[sensor]
    expected_s = clock.offset_s + np.arange(len(own)) / clock.rate_hz
    np.testing.assert_allclose((own - front[0]) * 1e-9, expected_s, atol=5 * STAMP_JITTER_S)
    assert not set(own) & set(front)
    assert len({clock.offset_s for clock in CLOCKS.values()}) == len(CLOCKS)


def test_a_clock_stops_with_the_front_camera():
    times_s = Clock(10.0, 0.03).times_s(5.0, 5.5, np.random.default_rng(0))
    assert len(times_s) == 5
    assert 5.0 < times_s[0] < times_s[-1] <= 5.5


def test_motion_poses_and_actors_come_with_the_front_camera_and_poses_with_all(measured):
    for moment in measured:
        is_front = "front" in moment.cameras
        assert moment.pose is not None
        assert (len(moment.motion) == 1, moment.actors is not None) == (is_front, is_front)
        assert len(moment.cameras) + len(moment.sweeps) == 1


def test_no_two_cameras_have_the_same_errors(measured):
    labels = {name: next(m.cameras[name].label_png for m in measured if name in m.cameras) for name in CAMERAS}
    errors = {name: error_stream((1, 2), name).random(4).tobytes() for name in (*CAMERAS, LIDAR)}
    assert len(set(errors.values())) == len(CAMERAS) + 1
    assert len(set(labels.values())) == len(CAMERAS)


@pytest.mark.parametrize("rig", [rig for rig in RIGS if rig != "surround+lidar"])
def test_a_sensor_is_the_same_byte_for_byte_whatever_is_beside_it(measured, rig):
    alone = islice(render_recording(replace(fastest_plan(), rig=rig)).moments(), 6)
    by_stamp = {moment.stamp_ns: moment for moment in measured}
    seen = set()
    for moment in alone:
        same = by_stamp[moment.stamp_ns]
        assert (same.cameras, same.motion, same.pose, same.actors) == (
            moment.cameras,
            moment.motion,
            moment.pose,
            moment.actors,
        )
        assert {name: sweep_message(each) for name, each in same.sweeps.items()} == {
            name: sweep_message(each) for name, each in moment.sweeps.items()
        }
        seen |= {*moment.cameras, *moment.sweeps}
    assert seen == set(RIGS[rig])


def test_the_front_camera_alone_is_planned_as_before_there_were_rigs():
    plan = fastest_plan()
    assert plan.description()["rig"] == "surround+lidar"
    assert "rig" not in replace(plan, rig="front").description()
    assert len({replace(plan, rig=rig).digest for rig in RIGS}) == len(RIGS)


def test_logs_of_a_rig_are_valid(measured, tmp_path):
    path = tmp_path / "town.mcap"
    recording = replace(render_recording(fastest_plan()), moments=lambda: iter(measured))
    write_log(recording, path)
    assert check_log(path).findings == ()


def test_errors_of_a_side_camera_are_drawn_again_by_its_own_random_numbers(measured, tmp_path):
    path = tmp_path / "town.mcap"
    write_log(replace(render_recording(fastest_plan()), moments=lambda: iter(measured)), path)
    with LogReader(path) as reader:
        for camera in ("front", "rear"):
            frames = list(reader.frames(camera))
            exact = (
                decode_gray(frames[2].exact_label_png, bit_depth=8),
                decode_gray(frames[2].exact_disparity_png, bit_depth=16),
            )
            errors = redrawing_of(reader, camera).after(1, Pictures(*exact))
            label, _ = errors.add(exact[0], decoded_disparity(exact[1]))
            assert np.array_equal(label, decode_gray(frames[2].label_png, bit_depth=8))
