"""ROS 2 bags of recordings with several cameras and LiDARs, written by `rosbags` itself."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from support import ros_messages as ros
from support.bags import LATE_NS, Sent, write_bag

from semgrid_eval.geometry import CAMERA_FROM_OPTICAL
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.png import decode_colour, decode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, Recording


@dataclass(frozen=True)
class Coding:
    """How clouds are written."""

    number: str = "f4"  # of x, y and z
    rows: int = 1  # of an organised cloud, whose last points are NaN where they do not fill a row
    padding: int = 0  # bytes at the end of a row
    big: bool = False
    labels: str = "u2"  # type of the numbers of labels; empty: without labels


@dataclass
class RigBag:
    """The messages of a bag that holds a recording: pictures and labels, disparity, clouds and odometry."""

    recording: Recording
    coding: Coding = Coding()
    labels: Mapping[int, np.ndarray] = field(default_factory=dict)  # of points, in place of label ids, by stamp
    late_ns: int = LATE_NS

    def write(self, path: Path, storage: str = "mcap") -> Path:
        return write_bag(path, self.messages(), storage)

    def map_text(self, *lines: str, ids: str = "label_ids") -> str:
        """The map file that fits, with more lines for each LiDAR."""
        text = ["motion:", "  speed: {topic: /odom, by: twist}"]
        for name, parts in self._parts().items():
            text += ["cameras:"] * ("cameras:" not in text)
            topics = {part: f"/{name}/{part}" for part in parts}
            text += [f"  {name}:", "    rectified: true", *(f"    {part}: {topic}" for part, topic in topics.items())]
        for name in self._lidars():
            text += ["lidars:"] * ("lidars:" not in text)
            text += [f"  {name}:", f"    cloud: /{name}/points", *(f"    {line}" for line in lines)]
            text += ["    label_field: label", f"    ids: {ids}"] * bool(self.coding.labels)
        return "\n".join(text) + "\n"

    def messages(self) -> Iterator[Sent]:
        """All messages as they are recorded."""
        return iter(sorted(self._in_any_order(), key=lambda sent: sent.received_ns))

    def _parts(self) -> dict[str, list[str]]:
        """What there is of each camera, as the keys of a map."""
        frames = [(name, frame) for moment in self.recording.moments() for name, frame in moment.cameras.items()]
        return {name: list(self._pictures(name, frame)) for name, frame in frames}

    def _lidars(self) -> list[str]:
        return sorted({name for moment in self.recording.moments() for name in moment.sweeps})

    def _in_any_order(self) -> Iterator[Sent]:
        first = next(iter(self.recording.moments()))
        for name, calibration in self.recording.calibrations.items():
            yield Sent("/tf_static", first.stamp_ns, camera_link(name, calibration))
        met: set[str] = set()
        for moment in self.recording.moments():
            for name, sweep in moment.sweeps.items():
                if name not in met:
                    yield Sent("/tf_static", first.stamp_ns, lidar_link(name, sweep))
                met.add(name)
                yield Sent(f"/{name}/points", moment.stamp_ns + self.late_ns, self.cloud(name, sweep))
            for sample in moment.motion:
                yield Sent("/odom", sample.stamp_ns + self.late_ns, ros.odometry(sample.stamp_ns, sample))
            for name, frame in moment.cameras.items():
                for part, message in self._pictures(name, frame).items():
                    yield Sent(f"/{name}/{part}", moment.stamp_ns + self.late_ns, message)

    def _pictures(self, name: str, frame: CameraFrame) -> dict[str, Any]:
        calibration, stamp_ns = self.recording.calibrations[name], frame.stamp_ns
        image = decode_colour(frame.image_file)
        found = {"info": ros.camera_info(stamp_ns, image.shape[1::-1], ros.matrix(calibration))}
        if frame.disparity_png is not None:
            disparity_px = decoded_disparity(decode_gray(frame.disparity_png, bit_depth=16))
            found["disparity"] = ros.disparity_image(stamp_ns, disparity_px, calibration)
        if frame.label_png is not None:
            label = decode_gray(frame.label_png, bit_depth=8).astype(np.uint8)
            found["labels"] = ros.image(stamp_ns, label, "mono8")
        return {**found, "image": ros.image(stamp_ns, image, "rgb8", frame=optical(name))}

    def cloud(self, name: str, sweep: LidarSweep) -> Any:
        """The cloud of a sweep."""
        coding = self.coding
        types = [*((axis, coding.number) for axis in "xyz"), ("intensity", "f4"), ("ring", "u2")]
        types += [("label", coding.labels)] * bool(coding.labels)
        count = -(-len(sweep.points_m) // coding.rows) * coding.rows
        points = np.zeros(count, types)
        for axis, column in zip("xyz", sweep.points_m.T, strict=True):
            points[axis] = np.nan
            points[axis][: len(column)] = column
        points["intensity"][: len(sweep.intensity)] = sweep.intensity
        if coding.labels:
            given = self.labels.get(sweep.stamp_ns, sweep.label_id)
            points["label"][: len(given)] = given
        message = ros.cloud(
            sweep.stamp_ns, points, frame=name, rows=coding.rows, padding=coding.padding, big=coding.big
        )
        message.is_dense = count == len(sweep.points_m)
        return message


def optical(name: str) -> str:
    """The optical frame of a camera."""
    return f"{name}_optical"


def camera_link(name: str, calibration: CameraCalibration) -> Any:
    place = (calibration.x_m, calibration.y_m, calibration.z_m)
    turn = calibration.ego_from_camera.rotation @ CAMERA_FROM_OPTICAL.rotation
    return ros.transforms((ros.VEHICLE, optical(name), turn, place))


def lidar_link(name: str, sweep: LidarSweep) -> Any:
    mount = sweep.mount
    return ros.transforms((ros.VEHICLE, name, mount.ego_from_sensor.rotation, mount.place_m))
