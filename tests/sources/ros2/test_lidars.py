"""Sweeps made of clouds: where they sit, which points are left, what time and labels they have."""

import math

import numpy as np
import pytest
from support.ros_messages import cloud, no_cloud, transforms

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.motion import EgoMotion, MotionSample
from semgrid_eval.sources.ros2.lidars import LidarPlan, Sweeps, plan_lidar
from semgrid_eval.sources.ros2.mapping import Extrinsics, LidarMap, PointTimes, VehicleMap
from semgrid_eval.sources.ros2.scan import Facts

STAMP_NS = 1_700_000_000_000_000_000
BARE, PLAIN = LidarMap(cloud="/points"), VehicleMap()
LINKS = (("base_link", "lidar", np.eye(3), (1.0, 2.0, 3.0)),)


def facts(*links):
    found = Facts(frames={"/points": "lidar"})
    found.transforms.add(transforms(*links))
    return found


def mount(lidar=BARE, vehicle=PLAIN, links=LINKS):
    return plan_lidar(lidar, vehicle, facts(*links)).mount


def test_a_lidar_sits_where_tf_says_in_the_vehicles_own_frame():
    turn = SE3.from_roll_pitch_yaw(0.0, 0.1, 0.4)
    links = (("base_link", "roof", np.eye(3), (0.5, 0.0, 1.5)), ("roof", "lidar", turn.rotation, (0.25, -0.5, 0.25)))
    found = mount(vehicle=VehicleMap(rear_axle_m=1.25, height_m=0.5), links=links)
    assert found.place_m == pytest.approx((2.0, -0.5, 2.25))
    assert np.allclose(found.ego_from_sensor.rotation, turn.rotation)


def test_a_lidar_sits_where_the_map_says_whatever_tf_does():
    given = Extrinsics(x_m=1.0, y_m=0.0, z_m=2.0, pitch_rad=0.1, yaw_rad=-0.3)
    found = mount(LidarMap(cloud="/points", extrinsics=given), links=())
    assert found.place_m == (1.0, 0.0, 2.0)
    assert np.allclose(found.ego_from_sensor.rotation, SE3.from_roll_pitch_yaw(0.0, 0.1, -0.3).rotation)


def test_a_missing_link_is_told():
    with pytest.raises(InputError, match="tf: no link from base_link to lidar; there are: base_link -> camera"):
        mount(links=(("base_link", "camera", np.eye(3), (0, 0, 0)),))


def sweep(columns, lidar=BARE, motion=()):
    """The sweep of a cloud of columns by name."""
    types = [(name, np.asarray(values).dtype) for name, values in columns.items()]
    points = np.zeros(len(columns["x"]), types)
    for name, values in columns.items():
        points[name] = values
    return Sweeps(LidarPlan(lidar, mount()), EgoMotion(motion, "arc")).sweep(STAMP_NS, cloud(STAMP_NS, points))


def columns(*places, **more):
    return {**dict(zip("xyz", np.array(places, np.float32).T, strict=True)), **more}


@pytest.mark.parametrize("label", [None, "label"])
def test_a_cloud_without_points_is_an_empty_sweep_whatever_fields_it_lacks(label):
    lidar = LidarMap(cloud="/points", label_field=label, times=PointTimes(field="t", unit="ns"))
    found = Sweeps(LidarPlan(lidar, mount()), EgoMotion((), "arc")).sweep(STAMP_NS, no_cloud(STAMP_NS))
    assert (found.points_m.shape, found.intensity.shape) == ((0, 3), (0,))
    assert (found.label_id is None) == (label is None)


def test_points_of_nothing_are_left_out_with_what_belongs_to_them():
    nan = math.nan
    given = columns((1, 2, 3), (nan, 2, 3), (0, 0, 0), (4, 5, math.inf), (7, 0, 0))
    more = {"intensity": np.arange(5, dtype=np.uint8), "label": np.array([7, 99, 99, 99, 26], np.uint8)}
    found = sweep(given | more, LidarMap(cloud="/points", label_field="label"))
    assert found.points_m.tolist() == [[1, 2, 3], [7, 0, 0]]
    assert found.intensity.tolist() == [0, 4]
    assert found.label_id.tolist() == [7, 26]
    assert found.stamp_ns == STAMP_NS


def test_points_need_neither_intensity_nor_labels():
    found = sweep(columns((1, 2, 3)))
    assert (found.intensity.tolist(), found.label_id) == ([0.0], None)


def test_labels_of_semantickitti_lose_their_instances():
    lidar = LidarMap(cloud="/points", label_field="label", ids="semantickitti")
    found = sweep(columns((1, 2, 3), (1, 2, 4)) | {"label": np.array([40, 252 | 7 << 16], np.uint32)}, lidar)
    assert found.label_id.tolist() == [LABEL_ID["road"], LABEL_ID["car"]]


@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.uint16, np.int32])
def test_labels_of_semantickitti_without_instances_fit_into_small_numbers(kind):
    lidar = LidarMap(cloud="/points", label_field="label", ids="semantickitti")
    found = sweep(columns((1, 2, 3), (1, 2, 4)) | {"label": np.array([40, 10], kind)}, lidar)
    assert found.label_id.tolist() == [LABEL_ID["road"], LABEL_ID["car"]]


def test_a_label_that_the_map_does_not_name():
    lidar = LidarMap(cloud="/points", label_field="label", ids={"road": (1,)})
    with pytest.raises(InputError, match=r"^ids: 70000 is a label, but not in the map$"):
        sweep(columns((1, 2, 3)) | {"label": np.array([70_000], np.int32)}, lidar)


S, NS = 1e-9, 1
TIMES = {
    "s since the stamp": ("s", "stamp", np.array([0.0, 0.05, 0.1], np.float32)),
    "s, before the stamp": ("s", "stamp", np.array([-0.1, -0.05, 0.0], np.float64)),
    "ms": ("ms", "stamp", np.array([0.0, 50.0, 100.0], np.float32)),
    "us": ("us", "stamp", np.array([0, 50_000, 100_000], np.uint32)),
    "ns": ("ns", "stamp", np.array([0, 50_000_000, 100_000_000], np.uint32)),
    "s since 1970": ("s", "epoch", STAMP_NS * S + np.array([0.0, 0.05, 0.1])),
    "ns since 1970": ("ns", "epoch", STAMP_NS + np.array([0.0, 5e7, 1e8])),
}


@pytest.mark.parametrize("name", TIMES)
def test_points_are_brought_to_the_time_of_the_stamp(name):
    """Straight on at 12 m/s, what is seen 10 m ahead 0.05 s later was 10.6 m ahead, and 0.1 s later 11.2 m."""
    unit, since, values = TIMES[name]
    driven = [MotionSample(STAMP_NS + offset, 12.0, 0.0) for offset in (-200_000_000, 200_000_000)]
    lidar = LidarMap(cloud="/points", times=PointTimes(field="t", unit=unit, since=since))
    found = sweep(columns((10, 0, 0), (10, 1, 0), (10, 2, 0)) | {"t": values}, lidar, driven)
    first_m = -1.2 if "before" in name else 0.0
    expected = [(10 + first_m + 0.6 * number, number, 0) for number in range(3)]
    assert np.allclose(found.points_m, expected, atol=1e-4)


def test_times_in_another_unit_are_told():
    lidar = LidarMap(cloud="/points", times=PointTimes(field="t", unit="s"))
    with pytest.raises(InputError) as raised:
        sweep(columns((1, 2, 3)) | {"t": np.array([5e7])}, lidar)
    told = "t: 5e+07 s since the stamp is not within 1 s of the stamp of the cloud; are unit and since right?"
    assert str(raised.value) == told


def test_times_of_points_that_are_left_out_do_not_matter():
    lidar = LidarMap(cloud="/points", times=PointTimes(field="t", unit="s"))
    given = columns((1, 2, 3), (math.nan,) * 3) | {"t": np.array([0.0, math.nan])}
    assert len(sweep(given, lidar).points_m) == 1


def test_a_place_that_no_lidar_sees_is_refused():
    with pytest.raises(InputError, match=r"^point 1, \(inf, 0, 0\) m, is not within 1000 m of the LiDAR$"):
        sweep({"x": np.array([1.0, 1e300]), "y": np.zeros(2), "z": np.zeros(2)})
