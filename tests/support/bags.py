"""ROS 2 bags made of recordings, written by `rosbags` itself."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from support import ros_messages as ros

from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_colour, decode_gray
from semgrid_eval.recording.types import CameraCalibration, MotionSample, Recording

STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
IMAGE, RIGHT = "/stereo/left/image_rect_color", "/stereo/right/image_rect_color"
DISPARITY, DEPTH = "/stereo/disparity", "/depth/image_rect"
LATE_NS = 4_000_000  # after which messages are recorded


class Sent(NamedTuple):
    """One message of a bag."""

    topic: str
    received_ns: int
    message: Any


def write_bag(path: Path, messages: Iterable[Sent], storage: str = "mcap", packed: str = "NONE") -> Path:
    """Write a bag folder, and return it; `packed` is a mode of compression: FILE, MESSAGE, or STORAGE (mcap)."""
    writer = Writer(path, version=9, storage_plugin=STORAGES[storage])
    writer.set_compression(CompressionMode[packed], CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, received_ns, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=ros.TYPES)
            data = ros.TYPES.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], received_ns, data)
    return path


@dataclass(frozen=True)
class Variant:
    """How a recording is written as a bag."""

    storage: str = "mcap"
    image: str = "rgb8"  # an encoding, or png, jpeg
    depth: str = "disparity"  # or 16UC1, 32FC1, compressedDepth, or right: the images that the bag is given
    labels: str = "mono8"  # or png, or nothing
    motion: str = "odometry"  # or pose, twist, imu
    late_ns: int = LATE_NS

    @property
    def map_text(self) -> str:
        """The map file that fits."""
        speed = {"odometry": "/odom, by: twist", "pose": "/odom, by: pose"}.get(self.motion, "/twist, by: twist")
        told = {"disparity": f"disparity: {DISPARITY}", "right": f"right: {RIGHT}"}
        depth = told.get(self.depth, f"depth: {DEPTH}")
        lines = [
            "motion:",
            f"  speed: {{topic: {speed}}}",
            *(["  yaw_rate: {topic: /imu}"] if self.motion == "imu" else []),
            "cameras:",
            "  front:",
            f"    image: {IMAGE}",
            "    info: /stereo/left/camera_info",
            "    right_info: /stereo/right/camera_info",
            "    rectified: true",
            f"    {depth}",
            *(["    labels: /labels", "    ids: label_ids"] if self.labels else []),
        ]
        return "\n".join(lines) + "\n"


@dataclass
class RecordingBag:
    """The messages of a bag that holds a recording of one camera."""

    recording: Recording
    variant: Variant = field(default_factory=Variant)
    rights: Mapping[int, np.ndarray] = field(default_factory=dict)  # gray images of the right camera, by stamp

    def write(self, path: Path) -> Path:
        return write_bag(path, self.messages(), self.variant.storage)

    def messages(self) -> Iterator[Sent]:
        (calibration,) = self.recording.calibrations.values()
        motion = EgoMotion()
        first = True
        for moment in self.recording.moments():
            ((_, frame),) = moment.cameras.items()
            now_ns = moment.stamp_ns + self.variant.late_ns
            if first:
                yield Sent("/tf_static", now_ns, ros.camera_transform(calibration))
            first = False
            for sample in moment.motion:
                motion.add(sample)
                place = motion.pose_at(sample.stamp_ns)
                yield from self._motion(sample, (place.x_m, place.y_m, place.yaw_rad), now_ns)
            disparity_px = decoded_disparity(decode_gray(frame.disparity_png, bit_depth=16))
            size = disparity_px.shape[1::-1]
            baseline_px = -calibration.fx_px * calibration.baseline_m
            for side, shift_px in (("left", 0.0), ("right", baseline_px)):
                info = ros.camera_info(moment.stamp_ns, size, ros.matrix(calibration), shift_px=shift_px)
                yield Sent(f"/stereo/{side}/camera_info", now_ns, info)
            yield Sent(IMAGE, now_ns, self._image(moment.stamp_ns, frame.image_file))
            yield self._depth(moment.stamp_ns, disparity_px, calibration)
            if frame.label_png is not None and self.variant.labels:
                yield Sent("/labels", now_ns + 1_000_000, self._labels(moment.stamp_ns, frame.label_png))

    def _motion(self, sample: MotionSample, pose: tuple[float, float, float], now_ns: int) -> Iterator[Sent]:
        if self.variant.motion in ("odometry", "pose"):
            wrong = MotionSample(sample.stamp_ns, 0.0, 0.0)  # who goes by poses must not look at twists
            told = sample if self.variant.motion == "odometry" else wrong
            yield Sent("/odom", now_ns, ros.odometry(sample.stamp_ns, told, pose))
            return
        told = sample if self.variant.motion == "twist" else MotionSample(sample.stamp_ns, sample.speed_mps, 0.0)
        yield Sent("/twist", now_ns, ros.twist(sample.stamp_ns, told))
        if self.variant.motion == "imu":
            yield Sent("/imu", now_ns, ros.imu(sample.stamp_ns, (0.0, 0.0, sample.yaw_rate_radps), ros.VEHICLE))

    def _image(self, stamp_ns: int, file: bytes) -> Any:
        how = self.variant.image
        if how == "png":
            return ros.compressed(stamp_ns, file, "png")
        pixels = decode_colour(file)
        if how == "jpeg":
            photo = cv2.imencode(".jpg", pixels[..., ::-1])[1].tobytes()
            return ros.compressed(stamp_ns, photo, "bgr8; jpeg compressed bgr8")
        if how == "mono8":
            return ros.image(stamp_ns, cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), how)
        return ros.image(stamp_ns, pixels if how == "rgb8" else pixels[..., ::-1], how, padding=5)

    def _depth(self, stamp_ns: int, disparity_px: np.ndarray, calibration: CameraCalibration) -> Sent:
        now_ns = stamp_ns + self.variant.late_ns + 500_000
        if self.variant.depth == "disparity":
            return Sent(DISPARITY, now_ns, ros.disparity_image(stamp_ns, disparity_px, calibration))
        if self.variant.depth == "right":
            return Sent(RIGHT, now_ns, ros.image(stamp_ns, self.rights[stamp_ns], "mono8"))
        with np.errstate(divide="ignore"):
            depth_m = calibration.fx_px * calibration.baseline_m / disparity_px.astype(np.float64)
        if self.variant.depth == "32FC1":
            return Sent(DEPTH, now_ns, ros.image(stamp_ns, depth_m.astype(np.float32), "32FC1"))
        depth_mm = np.where(depth_m < 65.535, np.rint(np.minimum(depth_m, 65.535) * 1000), 0).astype(np.uint16)
        if self.variant.depth == "16UC1":
            return Sent(DEPTH, now_ns, ros.image(stamp_ns, depth_mm, "16UC1"))
        file = bytes(12) + cv2.imencode(".png", depth_mm)[1].tobytes()
        return Sent(DEPTH, now_ns, ros.compressed(stamp_ns, file, "16UC1; compressedDepth png"))

    def _labels(self, stamp_ns: int, png: bytes) -> Any:
        if self.variant.labels == "png":
            return ros.compressed(stamp_ns, png, "png")
        return ros.image(stamp_ns, decode_gray(png, bit_depth=8).astype(np.uint8), "mono8")
