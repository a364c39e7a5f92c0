"""ROS 2 bags made of recordings, written by `rosbags` itself."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_colour, decode_gray
from semgrid_eval.recording.types import CameraCalibration, MotionSample, Recording

TYPES = get_typestore(Stores.ROS2_HUMBLE)
STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
OPTICAL, VEHICLE = "camera_left_optical", "base_link"
LATE_NS = 4_000_000  # after which messages are recorded


class Sent(NamedTuple):
    """One message of a bag."""

    topic: str
    received_ns: int
    message: Any

    @property
    def kind(self) -> str:
        return self.message.__msgtype__


def kind(name: str) -> Any:
    """Return the class of a message type, such as sensor_msgs/Image."""
    package, _, short = name.partition("/")
    return TYPES.types[f"{package}/msg/{short}"]


def write_bag(path: Path, messages: Iterable[Sent], storage: str = "mcap") -> Path:
    """Write a bag folder, and return it."""
    with Writer(path, version=9, storage_plugin=STORAGES[storage]) as writer:
        connections: dict[str, Any] = {}
        for topic, received_ns, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=TYPES)
            data = TYPES.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], received_ns, data)
    return path


def header(stamp_ns: int, frame: str) -> Any:
    stamp = kind("builtin_interfaces/Time")(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return kind("std_msgs/Header")(stamp=stamp, frame_id=frame)


_CODINGS = {"rgb8": 3, "bgr8": 3, "mono8": 1, "16UC1": 2, "32FC1": 4, "bayer_rggb8": 1, "bgra8": 4}


def image(stamp_ns: int, pixels: np.ndarray, encoding: str, *, frame: str = OPTICAL, padding: int = 0) -> Any:
    """Return an Image whose lines end with so many bytes that mean nothing."""
    height, width = pixels.shape[:2]
    lines = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    data = np.pad(lines, ((0, 0), (0, padding)), constant_values=77)
    return kind("sensor_msgs/Image")(
        header=header(stamp_ns, frame),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=data.shape[1],
        data=data.reshape(-1),
    )


def compressed(stamp_ns: int, file: bytes, name: str, *, frame: str = OPTICAL) -> Any:
    data = np.frombuffer(file, np.uint8)
    return kind("sensor_msgs/CompressedImage")(header=header(stamp_ns, frame), format=name, data=data)


def camera_info(
    stamp_ns: int,
    size: tuple[int, int],
    k: np.ndarray,
    *,
    shift_px: float = 0.0,
    d: Iterable[float] = (),
    p: bool = True,
) -> Any:
    """Return the calibration of a camera whose rectified image has the matrix k, with P[3] = shift_px."""
    projection = np.hstack([k, [[shift_px], [0.0], [0.0]]]) if p else np.zeros((3, 4))
    lens = list(d)
    return kind("sensor_msgs/CameraInfo")(
        header=header(stamp_ns, OPTICAL),
        height=size[1],
        width=size[0],
        distortion_model="plumb_bob",
        d=np.array(lens or [0.0] * 5),
        k=k.reshape(-1),
        r=np.eye(3).reshape(-1),
        p=projection.reshape(-1),
        binning_x=0,
        binning_y=0,
        roi=_roi(),
    )


def matrix(calibration: CameraCalibration) -> np.ndarray:
    """Return K (3, 3)."""
    c = calibration
    return np.array([[c.fx_px, 0.0, c.u0_px], [0.0, c.fy_px, c.v0_px], [0.0, 0.0, 1.0]])


def disparity_image(stamp_ns: int, disparity_px: np.ndarray, calibration: CameraCalibration) -> Any:
    """Return a DisparityImage; where there is no disparity it has -1, as stereo_image_proc's."""
    told = np.where(disparity_px > 0, disparity_px, np.float32(-1))
    return kind("stereo_msgs/DisparityImage")(
        header=header(stamp_ns, OPTICAL),
        image=image(stamp_ns, told.astype(np.float32), "32FC1"),
        f=calibration.fx_px,
        t=calibration.baseline_m,
        valid_window=_roi(),
        min_disparity=0.0,
        max_disparity=256.0,
        delta_d=1 / 16,
    )


def odometry(stamp_ns: int, sample: MotionSample, pose: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    with_covariance = {"covariance": np.zeros(36)}
    x_m, y_m, yaw_rad = pose
    place = kind("geometry_msgs/Pose")(position=_point(x_m, y_m), orientation=_turn(yaw_rad))
    return kind("nav_msgs/Odometry")(
        header=header(stamp_ns, "odom"),
        child_frame_id=VEHICLE,
        pose=kind("geometry_msgs/PoseWithCovariance")(pose=place, **with_covariance),
        twist=kind("geometry_msgs/TwistWithCovariance")(twist=_twist(sample), **with_covariance),
    )


def twist(stamp_ns: int, sample: MotionSample) -> Any:
    return kind("geometry_msgs/TwistStamped")(header=header(stamp_ns, VEHICLE), twist=_twist(sample))


def imu(stamp_ns: int, rates: tuple[float, float, float], frame: str = "imu") -> Any:
    zeros = np.zeros(9)
    return kind("sensor_msgs/Imu")(
        header=header(stamp_ns, frame),
        orientation=_turn(0.0),
        orientation_covariance=zeros,
        angular_velocity=_vector(*rates),
        angular_velocity_covariance=zeros,
        linear_acceleration=_vector(0.0, 0.0, 9.81),
        linear_acceleration_covariance=zeros,
    )


def transforms(*links: tuple[str, str, np.ndarray, tuple[float, float, float]]) -> Any:
    """Return a TFMessage of links: parent, child, rotation (3, 3) parent_from_child, place."""
    made = [
        kind("geometry_msgs/TransformStamped")(
            header=header(1, parent),
            child_frame_id=child,
            transform=kind("geometry_msgs/Transform")(translation=_vector(*place), rotation=_quaternion(rotation)),
        )
        for parent, child, rotation, place in links
    ]
    return kind("tf2_msgs/TFMessage")(transforms=made)


@dataclass(frozen=True)
class Variant:
    """How a recording is written as a bag."""

    storage: str = "mcap"
    image: str = "rgb8"  # an encoding, or png, jpeg
    depth: str = "disparity"  # or 16UC1, 32FC1, compressedDepth
    labels: str = "mono8"  # or png, or nothing
    motion: str = "odometry"  # or pose, twist, imu
    late_ns: int = LATE_NS

    @property
    def map_text(self) -> str:
        """The map file that fits."""
        speed = {"odometry": "/odom, by: twist", "pose": "/odom, by: pose"}.get(self.motion, "/twist, by: twist")
        depth = "disparity: /stereo/disparity" if self.depth == "disparity" else "depth: /depth/image_rect"
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


IMAGE = "/stereo/left/image_rect_color"


@dataclass
class RecordingBag:
    """The messages of a bag that holds a recording of one camera."""

    recording: Recording
    variant: Variant = field(default_factory=Variant)

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
                yield Sent("/tf_static", now_ns, camera_transform(calibration))
            first = False
            for sample in moment.motion:
                motion.add(sample)
                place = motion.pose_at(sample.stamp_ns)
                yield from self._motion(sample, (place.x_m, place.y_m, place.yaw_rad), now_ns)
            disparity_px = decoded_disparity(decode_gray(frame.disparity_png, bit_depth=16))
            size = disparity_px.shape[1::-1]
            baseline_px = -calibration.fx_px * calibration.baseline_m
            for side, shift_px in (("left", 0.0), ("right", baseline_px)):
                info = camera_info(moment.stamp_ns, size, matrix(calibration), shift_px=shift_px)
                yield Sent(f"/stereo/{side}/camera_info", now_ns, info)
            yield Sent(IMAGE, now_ns, self._image(moment.stamp_ns, frame.image_file))
            yield self._depth(moment.stamp_ns, disparity_px, calibration)
            if frame.label_png is not None and self.variant.labels:
                yield Sent("/labels", now_ns + 1_000_000, self._labels(moment.stamp_ns, frame.label_png))

    def _motion(self, sample: MotionSample, pose: tuple[float, float, float], now_ns: int) -> Iterator[Sent]:
        if self.variant.motion in ("odometry", "pose"):
            wrong = MotionSample(sample.stamp_ns, 0.0, 0.0)  # who goes by poses must not look at twists
            told = sample if self.variant.motion == "odometry" else wrong
            yield Sent("/odom", now_ns, odometry(sample.stamp_ns, told, pose))
            return
        told = sample if self.variant.motion == "twist" else MotionSample(sample.stamp_ns, sample.speed_mps, 0.0)
        yield Sent("/twist", now_ns, twist(sample.stamp_ns, told))
        if self.variant.motion == "imu":
            yield Sent("/imu", now_ns, imu(sample.stamp_ns, (0.0, 0.0, sample.yaw_rate_radps), VEHICLE))

    def _image(self, stamp_ns: int, file: bytes) -> Any:
        how = self.variant.image
        if how == "png":
            return compressed(stamp_ns, file, "png")
        pixels = decode_colour(file)
        if how == "jpeg":
            return compressed(
                stamp_ns, cv2.imencode(".jpg", pixels[..., ::-1])[1].tobytes(), "bgr8; jpeg compressed bgr8"
            )
        if how == "mono8":
            return image(stamp_ns, cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), how)
        return image(stamp_ns, pixels if how == "rgb8" else pixels[..., ::-1], how, padding=5)

    def _depth(self, stamp_ns: int, disparity_px: np.ndarray, calibration: CameraCalibration) -> Sent:
        now_ns = stamp_ns + self.variant.late_ns + 500_000
        if self.variant.depth == "disparity":
            return Sent("/stereo/disparity", now_ns, disparity_image(stamp_ns, disparity_px, calibration))
        with np.errstate(divide="ignore"):
            depth_m = calibration.fx_px * calibration.baseline_m / disparity_px.astype(np.float64)
        if self.variant.depth == "32FC1":
            return Sent("/depth/image_rect", now_ns, image(stamp_ns, depth_m.astype(np.float32), "32FC1"))
        depth_mm = np.where(depth_m < 65.535, np.rint(np.minimum(depth_m, 65.535) * 1000), 0).astype(np.uint16)
        if self.variant.depth == "16UC1":
            return Sent("/depth/image_rect", now_ns, image(stamp_ns, depth_mm, "16UC1"))
        file = bytes(12) + cv2.imencode(".png", depth_mm)[1].tobytes()
        return Sent("/depth/image_rect", now_ns, compressed(stamp_ns, file, "16UC1; compressedDepth png"))

    def _labels(self, stamp_ns: int, png: bytes) -> Any:
        if self.variant.labels == "png":
            return compressed(stamp_ns, png, "png")
        return image(stamp_ns, decode_gray(png, bit_depth=8).astype(np.uint8), "mono8")


def camera_transform(calibration: CameraCalibration) -> Any:
    """Return the static transform of a camera, by way of a second frame."""
    from semgrid_eval.geometry import CAMERA_FROM_OPTICAL

    camera = calibration.ego_from_camera
    place = (calibration.x_m, calibration.y_m, calibration.z_m)
    return transforms(
        (VEHICLE, "camera", camera.rotation, place),
        ("camera", OPTICAL, CAMERA_FROM_OPTICAL.rotation, (0.0, 0.0, 0.0)),
    )


def _roi() -> Any:
    return kind("sensor_msgs/RegionOfInterest")(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)


def _point(x: float, y: float) -> Any:
    return kind("geometry_msgs/Point")(x=x, y=y, z=0.0)


def _vector(x: float, y: float, z: float) -> Any:
    return kind("geometry_msgs/Vector3")(x=float(x), y=float(y), z=float(z))


def _twist(sample: MotionSample) -> Any:
    linear, angular = _vector(sample.speed_mps, 0, 0), _vector(0, 0, sample.yaw_rate_radps)
    return kind("geometry_msgs/Twist")(linear=linear, angular=angular)


def _turn(yaw_rad: float) -> Any:
    return kind("geometry_msgs/Quaternion")(x=0.0, y=0.0, z=float(np.sin(yaw_rad / 2)), w=float(np.cos(yaw_rad / 2)))


def _quaternion(rotation: np.ndarray) -> Any:
    """Return the quaternion of a rotation by less than half a turn."""
    w = np.sqrt(max(0.0, 1 + np.trace(rotation))) / 2
    x, y, z = ((rotation[j, i] - rotation[i, j]) / (4 * w) for i, j in ((1, 2), (2, 0), (0, 1)))
    return kind("geometry_msgs/Quaternion")(x=float(x), y=float(y), z=float(z), w=float(w))
