"""LiDARs whose points have labels: each sweep is an observation of its own time."""

import heapq
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semgrid_eval.errors import LogError
from semgrid_eval.sensors.sensor import Morphology, Points, SensorConfig

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader
    from semgrid_eval.recording.lidar import LidarSweep


class LidarSensor(SensorConfig):
    """All points of a LiDAR that have a label of a grid class."""

    kind: Literal["lidar"] = "lidar"
    lidar: str | None = None  # its name in the log; None takes a log's only one
    # The paper's kernels close gaps of one cell and then delete what is less than four cells wide. Rings on the ground
    # are one cell wide and farther apart than that, from some 15 m on for 64 rings: so nothing is done by default.
    morphology: Morphology | None = Field("off")


def read_lidars(
    log: "LogReader", sensors: Mapping[str, LidarSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what LiDARs see, each sweep decoded once, as `Kind` says."""
    by_lidar: dict[str, list[str]] = {}
    for name, sensor in sensors.items():
        by_lidar.setdefault(log.choose_lidar(sensor.lidar), []).append(name)
    streams = [_read_lidar(log, lidar, names, class_by_label) for lidar, names in by_lidar.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)


def _read_lidar(log: "LogReader", lidar: str, names: list[str], class_by_label: NDArray[np.uint8]) -> Iterator[Points]:
    for sweep in log.sweeps(lidar):
        if sweep.label_id is None:
            place = f"sweep of {lidar} at {sweep.stamp_ns} ns"
            raise LogError("has no labels; a grid needs one for each point", path=log.path, field=place)
        place_m = _in_vehicle(sweep)
        for name in names:
            yield Points(name, sweep.stamp_ns, place_m[:, 0], place_m[:, 1], class_by_label[sweep.label_id])


def _in_vehicle(sweep: "LidarSweep") -> NDArray[np.float64]:
    """Bring the points of a sweep into the vehicle frame: (N, 3)."""
    return sweep.mount.ego_from_sensor.apply(sweep.points_m.astype(np.float64))
