"""Points of a LiDAR coloured by a camera's label images: every place is worked out by hand.

The camera has 100 px of focal length and 400 x 200 px with its middle at (200, 100), stands 2 m above the ground and
looks straight ahead: what is Z m ahead, y m left and z m high is at u = 200 - 100 y / Z, v = 100 + 100 (2 - z) / Z.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.single import single
from support.swept import START_NS, recorded, sweep
from support.toy_world import png

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES, NO_POINT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import LogError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.lidar import Mount
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, Moment, MotionSample
from semgrid_eval.sensors.colouring import reach_px
from semgrid_eval.sensors.lidar import ColourFrom, LidarSensor, read_lidars

WIDTH, HEIGHT = 400, 200
CAMERA = CameraCalibration(100.0, 100.0, 200.0, 100.0, 0.5, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0)
MOUNT = Mount((0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.0))
MS = 1_000_000
BUILDING, CAR, POLE, ROAD = (CLASS_NAMES.index(name) for name in ("building", "car", "pole_sign", "road"))


def label_image(fill="sky", shape=(HEIGHT, WIDTH), **places):
    """A label image with single pixels, or slices of rows and columns, by name."""
    found = np.full(shape, LABEL_ID[fill], np.uint8)
    for name, place in places.items():
        found[place] = LABEL_ID[name]
    return found


def frame(after_ms, label):
    disparity = np.full((HEIGHT, WIDTH), 500, np.uint16)
    return CameraFrame(START_NS + after_ms * MS, None, png(disparity), None if label is None else png(label))


def classes(tmp_path, points, images, *, calibration=CAMERA, at_ms=0, speed=0.0, yaw_rate=0.0, **settings):
    """Classes of points, given in the LiDAR's axes in the place of the camera, at one sweep beside label images."""
    times = {ms: frame(ms, image) for ms, image in images.items()}

    def moments():
        for ms in sorted({*times, at_ms, -200, 200}):
            stamp_ns = START_NS + ms * MS
            cameras = {"front": times[ms]} if ms in times else {}
            sweeps = {"top": sweep(stamp_ns, points, mount=MOUNT)} if ms == at_ms else {}
            yield Moment(stamp_ns, cameras, (MotionSample(stamp_ns, speed, yaw_rate),), sweeps=sweeps)

    recording = recorded(moments)
    recording.calibrations["front"] = calibration
    write_log(recording, tmp_path / "log.mcap")
    sensor = LidarSensor(colour_from=ColourFrom(**settings))
    with LogReader(tmp_path / "log.mcap") as log:
        (found,) = read_lidars(log, {"top": sensor}, DEFAULT_CLASSES.class_by_label())
    return found.class_id.tolist()


def test_a_point_takes_the_label_of_its_pixel(tmp_path):
    image = label_image(car=(110, 190), pole=(100, 220))
    points = [(10, 1, -1), (10, -2, 0), (10, 1, 0)]
    assert classes(tmp_path, points, {0: image}) == [CAR, POLE, NO_POINT]


def test_pixels_are_met_at_their_middles(tmp_path):
    """The pixel 190 reaches from 189.5 to 190.5, which is y = 1.05 to 0.95 m at 10 m."""
    image = label_image(car=(100, 190))
    points = [(10, 1.06, 0), (10, 1.04, 0), (10, 0.96, 0), (10, 0.94, 0)]
    assert classes(tmp_path, points, {0: image}) == [NO_POINT, CAR, CAR, NO_POINT]


def test_what_the_camera_does_not_see_gives_nothing(tmp_path):
    points = [(-10, 0, 0), (0, 3, 0), (10, 20.1, 0), (10, -20.1, 0), (10, 0, 10.1), (10, 0, -10.1), (10, 19.9, 9.9)]
    assert classes(tmp_path, points, {0: label_image("road")}) == [NO_POINT] * 6 + [ROAD]


def test_label_images_may_be_smaller_than_the_camera_was_calibrated_for(tmp_path):
    """Pixel 95 of 200 is the pixels 190 and 191 of 400."""
    image = label_image(shape=(100, 200), car=(50, 95))
    points = [(10, 1.04, -0.04), (10, 0.86, -0.04), (10, 1.06, -0.04)]
    assert classes(tmp_path, points, {0: image}) == [CAR, CAR, NO_POINT]


def test_points_are_moved_to_the_time_of_the_image(tmp_path):
    """At 10 m/s, what is 10 m ahead and 1.9 m left is 9.5 m ahead 50 ms later: at u = 180, not 181."""
    image = label_image(car=(100, 180), pole=(100, 181))
    assert classes(tmp_path, [(10, 1.9, 0)], {50: image}, speed=10.0) == [CAR]
    assert classes(tmp_path, [(10, 1.9, 0)], {-50: label_image(car=(100, 182))}, speed=10.0) == [CAR]
    assert classes(tmp_path, [(10, 1.9, 0)], {50: image}) == [POLE]


def test_points_are_turned_to_the_time_of_the_image(tmp_path):
    """At 1 rad/s to the left, what was straight ahead is 0.05 rad to the right 50 ms later, at 200 + 100 tan 0.05."""
    column = round(200 + 100 * math.tan(0.05))
    assert column == 205
    image = label_image(car=(100, column))
    assert classes(tmp_path, [(10, 0, 0)], {50: image}, yaw_rate=1.0) == [CAR]


@pytest.mark.parametrize(
    ("times_ms", "expected"),
    [((-30, 40), POLE), ((-40, 30), CAR), ((-30, 30), POLE), ((0, 40), POLE), ((-90, -10, 20), CAR), ((60, 80), POLE)],
)
def test_the_nearest_image_counts_and_of_two_as_near_the_earlier(tmp_path, times_ms, expected):
    """The nearest of several: the first is all poles, the second all cars, and the third all sky."""
    images = dict(zip(times_ms, map(label_image, ("pole", "car", "sky")), strict=False))
    assert classes(tmp_path, [(10, 0, 0)], images) == [expected]


@pytest.mark.parametrize(("within_s", "expected"), [(0.05, CAR), (0.049, NO_POINT)])
def test_images_of_another_time_give_nothing(tmp_path, within_s, expected):
    assert classes(tmp_path, [(10, 0, 0)], {-50: label_image("car")}, within_s=within_s) == [expected]


def test_what_stands_behind_something_nearer_gives_nothing(tmp_path):
    """A LiDAR sees over a car 10 m ahead; 40 m ahead, three rows below its roof, the pixel shows the car."""
    image = label_image("road", car=np.s_[105:125, 150:250])
    roof, ground = (10, 0, -0.5), (40, 0.4, -3.2)  # rows 105 and 108, columns 200 and 199
    assert classes(tmp_path, [roof, ground], {0: image}, occlusion_rad=0.03) == [CAR, NO_POINT]
    assert classes(tmp_path, [roof, ground], {0: image}, occlusion_rad=0.02) == [CAR, CAR]
    assert classes(tmp_path, [ground], {0: image}, occlusion_rad=0.03) == [CAR]


@pytest.mark.parametrize(
    ("across", "down", "expected"), [(6, 0, NO_POINT), (7, 0, CAR), (0, 3, NO_POINT), (0, 4, CAR), (6, 3, NO_POINT)]
)
def test_what_hides_reaches_as_far_as_the_focal_lengths_say(tmp_path, across, down, expected):
    """0.03 rad are 6 columns of 200 px of focal length, and 3 rows of 100."""
    far, near = (20, 0, 0), (10, 10 * across / 200, 10 * down / 100)
    camera = replace(CAMERA, fx_px=200.0)
    found = classes(tmp_path, [far, near], {0: label_image("car")}, calibration=camera, occlusion_rad=0.03)
    assert found == [expected, CAR]


@pytest.mark.parametrize("scale", [0.25, 1, 4])
def test_a_car_hides_the_wall_behind_it_in_images_of_any_size(tmp_path, scale):
    """64 rings, 0.0075 rad apart, of points 0.0035 rad apart, are 13 rows and 6 columns apart at 1,700 px.

    The wall is seen in the middle between the points of a car on the left, and beside it on the right.
    """
    rings, azimuths = 0.0075 * np.arange(-6, 7), 0.0035 * np.arange(2, 20)
    car = [(10, 10 * across, 10 * up) for up in rings for across in azimuths]
    behind = [(40, 40 * across, 40 * up) for up in rings[:-1] + 0.00375 for across in azimuths[:-1] + 0.00175]
    beside = [(40, -40 * across, 40 * up) for up in rings for across in azimuths]
    shape = (round(HEIGHT * scale), round(WIDTH * scale))
    image = label_image("building", shape, car=np.s_[:, : shape[1] // 2])
    camera = replace(CAMERA, fx_px=1700.0, fy_px=1700.0)
    expected = [CAR] * len(car) + [NO_POINT] * len(behind) + [BUILDING] * len(beside)
    assert classes(tmp_path, [*car, *behind, *beside], {0: image}, calibration=camera) == expected


@pytest.mark.parametrize(("focal_px", "size_px"), [(707.0912, (1226, 370)), (718.856, (1241, 376))])
def test_by_default_what_hides_reaches_4_px_in_images_of_kitti(focal_px, size_px):
    camera = replace(CAMERA, fx_px=focal_px, fy_px=focal_px)
    assert reach_px(ColourFrom().occlusion_rad, camera, size_px, size_px[::-1]) == (4, 4)


def test_what_hides_never_reaches_farther_than_the_image():
    camera = replace(CAMERA, fx_px=1e300, fy_px=1e300)
    assert reach_px(0.05, camera, (WIDTH, HEIGHT), (50, 100)) == (50, 100)


@pytest.mark.parametrize(("nearer_m", "expected"), [(8.4, NO_POINT), (8.6, CAR), (10.0, CAR)])
def test_a_surface_does_not_hide_itself(tmp_path, nearer_m, expected):
    """What is not nearer by 15 % is the same thing, seen from aside."""
    points = [(10, 0, 0), (nearer_m, 0, 0)]
    assert classes(tmp_path, points, {0: label_image("car")}) == [expected, CAR]


def test_points_behind_the_camera_hide_nothing(tmp_path):
    assert classes(tmp_path, [(10, 0, 0), (-5, 0, 0)], {0: label_image("car")}) == [CAR, NO_POINT]


def test_several_sweeps_each_find_their_image(tmp_path):
    names = ("car", "pole", "road", "car")
    images = {ms: frame(ms, label_image(name)) for ms, name in zip((5, 62, 121, 180), names, strict=True)}

    def moments():
        for ms in sorted({*images, 0, 100, 200}):
            stamp_ns = START_NS + ms * MS
            sweeps = {"top": sweep(stamp_ns, [(10, 0, 0)], mount=MOUNT)} if ms % 100 == 0 else {}
            cameras = {"front": images[ms]} if ms in images else {}
            yield Moment(stamp_ns, cameras, (MotionSample(stamp_ns, 0.0, 0.0),), sweeps=sweeps)

    recording = recorded(moments)
    recording.calibrations["front"] = CAMERA
    write_log(recording, tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as log:
        sensors = {"top": LidarSensor(colour_from=ColourFrom())}
        found = [points.class_id.tolist() for points in read_lidars(log, sensors, DEFAULT_CLASSES.class_by_label())]
    assert found == [[CAR], [ROAD], [CAR]]


def test_of_several_cameras_the_first_that_sees_a_point_gives_its_label(tmp_path):
    """The second one looks back, and sees what is behind; what both miss has no class."""
    back = replace(CAMERA, yaw_rad=math.pi)
    images = {"ahead": frame(0, label_image("car")), "back": frame(0, label_image("pole"))}
    points = [(10, 1, 0), (-10, 1, 0), (0, 10, 0)]
    sweeps = {"top": sweep(START_NS, points, mount=MOUNT)}

    def moments():
        yield Moment(START_NS, images, (MotionSample(START_NS, 0.0, 0.0),), sweeps=sweeps)

    cameras = {"ahead": CAMERA, "back": back, "above": CAMERA}
    images["above"] = frame(0, label_image("road"))
    write_log(replace(recorded(moments), calibrations=cameras), tmp_path / "log.mcap")
    found = {}
    with LogReader(tmp_path / "log.mcap") as log:
        for names in (("ahead", "back"), ("back", "above", "ahead"), ("back",)):
            sensors = {"top": LidarSensor(colour_from=ColourFrom(camera=names))}
            (seen,) = read_lidars(log, sensors, DEFAULT_CLASSES.class_by_label())
            found[names] = seen.class_id.tolist()
    assert found == {
        ("ahead", "back"): [CAR, POLE, NO_POINT],
        ("back", "above", "ahead"): [ROAD, POLE, NO_POINT],
        ("back",): [NO_POINT, POLE, NO_POINT],
    }


@pytest.mark.parametrize(
    ("settings", "image", "line"),
    [
        ({"camera": "rear"}, label_image(), r"log\.mcap: camera: 'rear' is not front, the only choice$"),
        ({}, None, r"frame of front at 1\d+ ns: has no label image to colour points by; `semgrid-eval segment` adds"),
    ],
)
def test_what_cannot_be_coloured_is_told_in_a_line(tmp_path, settings, image, line):
    with pytest.raises(LogError, match=line):
        classes(tmp_path, [(10, 0, 0)], {0: image}, **settings)


def test_without_colouring_configurations_keep_their_digests():
    config = parse_config(GridConfig, {"sensors": {"top": {"kind": "lidar"}}, "target": ["top"]})
    assert "colour_from" not in config.model_dump(mode="json")["sensors"]["top"]
    coloured = parse_config(GridConfig, {"sensors": {"top": {"kind": "lidar", "colour_from": {}}}, "target": ["top"]})
    assert coloured.sensors["top"].colour_from == ColourFrom()
    assert parse_config(GridConfig, coloured.model_dump(mode="json")) == coloured


def test_a_camera_without_disparity_colours_as_the_same_with_it(tmp_path):
    found = []
    for name, change in (("stereo", lambda recording: recording), ("single", single)):
        write_log(change(rig_of(label_image(car=(110, 190)))), tmp_path / f"{name}.mcap")
        with LogReader(tmp_path / f"{name}.mcap") as log:
            sensors = {"top": LidarSensor(colour_from=ColourFrom())}
            (points,) = read_lidars(log, sensors, DEFAULT_CLASSES.class_by_label())
        found.append(points.class_id.tolist())
    assert found == [[CAR, NO_POINT]] * 2


def rig_of(label):
    """One sweep beside one frame."""
    points = [(10, 1, -1), (10, -2, 0)]

    def moments():
        sweeps = {"top": sweep(START_NS, points, mount=MOUNT)}
        yield Moment(START_NS, {"front": frame(0, label)}, (MotionSample(START_NS, 0.0, 0.0),), sweeps=sweeps)

    return replace(recorded(moments), calibrations={"front": CAMERA})
