"""One LiDAR of a bag: where it sits, and sweeps of the log made of its clouds."""

from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.sources.deskewing import deskewed
from semgrid_eval.sources.kitti.labels import classes_of
from semgrid_eval.sources.ros2.clouds import INTENSITY, PLACE, Extras, columns_of, is_empty, returned
from semgrid_eval.sources.ros2.labels import LabelTable
from semgrid_eval.sources.ros2.mapping import HIGHEST_POINT, LidarMap, PointTimes, VehicleMap
from semgrid_eval.sources.ros2.scan import Facts

NS_BY_UNIT = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
_NS_PER_MS = 1e6
LONGEST_NS = 1e9
"""No turn of a LiDAR takes longer."""
_SHARES = (0.05, 1.5)
"""How much of the time from a cloud to the next one its points are measured in."""
Columns = NDArray[np.void]


@dataclass(frozen=True)
class LidarPlan:
    """What turns the clouds of one LiDAR into sweeps; it travels to another process."""

    lidar: LidarMap
    mount: Mount

    def described(self) -> list[Any]:
        """Return as JSON what determines the sweeps, but for the messages and the motion."""
        return [self.lidar.model_dump(mode="json"), asdict(self.mount)]


def plan_lidar(lidar: LidarMap, vehicle: VehicleMap, facts: Facts) -> LidarPlan:
    """Work out where a LiDAR sits.

    Raises:
        InputError: nothing links it to the vehicle.
    """
    place = lidar.extrinsics
    if place is None:
        frame_from_lidar = facts.transforms.lookup(vehicle.frame, lidar.frame or facts.frames[lidar.cloud])
    else:
        place_m = (place.x_m, place.y_m, place.z_m)
        frame_from_lidar = SE3.from_roll_pitch_yaw(place.roll_rad, place.pitch_rad, place.yaw_rad, place_m)
    ego_from_frame = SE3(np.eye(3), np.array([vehicle.rear_axle_m, 0.0, vehicle.height_m]))
    return LidarPlan(lidar, Mount.of(ego_from_frame @ frame_from_lidar))


def unit_that_fills(span: float, period_ns: float) -> str | None:
    """Return the unit in which the times of a cloud's points, `span` apart, are those of a turn until the next cloud.

    There is one at most.
    """
    low_ns, high_ns = _SHARES[0] * period_ns, min(_SHARES[1] * period_ns, LONGEST_NS)
    return next((unit for unit, unit_ns in NS_BY_UNIT.items() if low_ns <= span * unit_ns <= high_ns), None)


def odd_times(name: str, lidar: LidarMap, facts: Facts) -> str:
    """Say if the times of points tell nothing, or fit how often clouds come in another unit; else empty."""
    stamps_ns, spans = facts.arrivals[lidar.cloud].stamps_ns, facts.spans.get(name)
    if lidar.times is None or not spans:
        return ""
    field, unit = lidar.times.field, lidar.times.unit
    if not any(spans):
        return f"times of points are all the same in each cloud of {name} (its {field}): they count as of one time"
    if len(stamps_ns) < 2:
        return ""
    span, period_ns = median(spans), float(np.median(np.diff(stamps_ns)))
    better = unit_that_fills(span, period_ns)
    if better in (None, unit):
        return ""
    told = f"a cloud of {name} takes {span * NS_BY_UNIT[unit] / _NS_PER_MS:.3g} ms by its {field}"
    return f"{told} and one comes every {period_ns / _NS_PER_MS:.3g} ms: is its unit {better}, not {unit}?"


class Sweeps:
    """Makes the sweeps of one LiDAR; `motion` is the vehicle's around them."""

    def __init__(self, plan: LidarPlan, motion: EgoMotion) -> None:
        self._lidar, self._mount, self._motion = plan.lidar, plan.mount, motion
        self._labels = LabelTable(plan.lidar.ids, HIGHEST_POINT)

    def sweep(self, stamp_ns: int, message: Any) -> LidarSweep:  # noqa: ANN401 - a class that rosbags makes
        """Make the sweep of a cloud: its points at the time of its stamp, without those that nothing sent back.

        Raises:
            InputError: the cloud is not what the map says, or a label, time or place is impossible.
        """
        if is_empty(message):
            return self._empty(stamp_ns)
        points = columns_of(message, Extras.of(self._lidar))
        points = points[returned(points)]
        place_m = np.stack([points[axis] for axis in PLACE], axis=1).astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):  # what is too large then is refused
            moved_m = self._at_stamp(place_m, points, stamp_ns).astype(np.float32)
            intensity = _intensity(points)
        return LidarSweep(stamp_ns, self._mount, moved_m, intensity, self._label_id(points))

    def _empty(self, stamp_ns: int) -> LidarSweep:
        label_id = None if self._lidar.label_field is None else np.zeros(0, np.uint8)
        return LidarSweep(stamp_ns, self._mount, np.zeros((0, 3), np.float32), np.zeros(0, np.float32), label_id)

    def _at_stamp(self, place_m: NDArray[np.float64], points: Columns, stamp_ns: int) -> NDArray[np.float64]:
        if self._lidar.times is None:
            return place_m
        offset_ns = _offsets_ns(points, self._lidar.times, stamp_ns)
        return deskewed(place_m, offset_ns, stamp_ns, self._mount.ego_from_sensor, self._motion)

    def _label_id(self, points: Columns) -> NDArray[np.uint8] | None:
        if self._lidar.label_field is None:
            return None
        given = points[self._lidar.label_field]
        return self._labels.label_ids(classes_of(given) if self._lidar.ids == "semantickitti" else given)


def _intensity(points: Columns) -> NDArray[np.float32]:
    known = INTENSITY in (points.dtype.names or ())
    return points[INTENSITY].astype(np.float32) if known else np.zeros(len(points), np.float32)


def _offsets_ns(points: Columns, times: PointTimes, stamp_ns: int) -> NDArray[np.float64]:
    """Return how long after the stamp of its cloud each point was measured: (N,)."""
    since_ns = stamp_ns if times.since == "epoch" else 0
    offset_ns = points[times.field].astype(np.float64) * NS_BY_UNIT[times.unit] - since_ns
    wrong = np.flatnonzero(~(np.abs(offset_ns) <= LONGEST_NS))
    if len(wrong):
        value = points[times.field][wrong[0]]
        told = f"{value:g} {times.unit} since the {times.since} is not within 1 s of the stamp of the cloud"
        raise InputError(f"{told}; are unit and since right?", field=times.field)
    return np.asarray(offset_ns, np.float64)
