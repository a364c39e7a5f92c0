"""A LiDAR in a world of poles: sweeps made by school geometry, which shares no code with the package's own."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.recording.types import Moment, MotionSample, Recording

START_NS = 10**18
Place = tuple[float, float, float]
TURNED = Mount((1.2, 0.3, 1.8), (0.0, 0.0, math.sin(0.2), math.cos(0.2)))
"""0.4 rad to the left, somewhere on the roof."""


@dataclass(frozen=True)
class Drive:
    """A vehicle on an arc."""

    speed_mps: float = 10.0
    yaw_rate_radps: float = 0.0

    def pose_at(self, since_ns: int) -> Place:
        t, w, v = since_ns * 1e-9, self.yaw_rate_radps, self.speed_mps
        if w:
            return v / w * math.sin(w * t), v / w * (1 - math.cos(w * t)), w * t
        return v * t, 0.0, 0.0


def sweep(stamp_ns: int, points: Sequence[Sequence[float]], labels: Sequence[str] | None = None, mount=TURNED):
    """A sweep of points in the LiDAR's own frame."""
    given = np.array(points, np.float32).reshape(-1, 3)
    ids = None if labels is None else np.array([LABEL_ID[label] for label in labels], np.uint8)
    return LidarSweep(stamp_ns, mount, given, np.arange(len(given), dtype=np.float32) / 8, ids)


def seen(stamp_ns: int, pose: Place, places: Sequence[tuple[float, float]], label: str = "pole", mount=TURNED):
    """A sweep of points that stand at places of the world, 1 m high, seen from a pose of the vehicle."""
    x, y, yaw = pose
    turn = yaw + 2 * math.asin(mount.turn[2])
    eye = (
        x + math.cos(yaw) * mount.place_m[0] - math.sin(yaw) * mount.place_m[1],
        y + math.sin(yaw) * mount.place_m[0] + math.cos(yaw) * mount.place_m[1],
    )
    points = []
    for px, py in places:
        dx, dy = px - eye[0], py - eye[1]
        along, across = math.cos(turn) * dx + math.sin(turn) * dy, math.cos(turn) * dy - math.sin(turn) * dx
        points.append((along, across, 1.0 - mount.place_m[2]))
    return sweep(stamp_ns, points, [label] * len(points), mount)


def recorded(moments: Callable[[], Iterator[Moment]], name: str = "swept") -> Recording:
    """Wrap moments that have sweeps alone."""
    return Recording(name, "toy", "val", {}, "d" * 16, moments)


def scanned(drive: Drive, times_ns: Sequence[int], places: Sequence[tuple[float, float]], **told) -> Recording:
    """A drive by places with poles, scanned at some times since the start."""

    def moments() -> Iterator[Moment]:
        for since_ns in times_ns:
            stamp_ns = START_NS + since_ns
            sample = MotionSample(stamp_ns, drive.speed_mps, drive.yaw_rate_radps)
            yield Moment(
                stamp_ns, {}, (sample,), sweeps={"top": seen(stamp_ns, drive.pose_at(since_ns), places, **told)}
            )

    return recorded(moments)
