"""Messages of ROS 2 as `rosbags` has them, made for tests."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from semgrid_eval.geometry import CAMERA_FROM_OPTICAL
from semgrid_eval.recording.types import CameraCalibration, MotionSample

TYPES = get_typestore(Stores.ROS2_HUMBLE)
TYPES.register(get_types_from_msg("float64 x_m\n", "my_msgs/msg/Pose"))  # which ROS 2 itself does not have
OPTICAL, VEHICLE, LIDAR = "camera_left_optical", "base_link", "lidar"


def kind(name: str) -> Any:
    """Return the class of a message type, such as sensor_msgs/Image."""
    package, _, short = name.partition("/")
    return TYPES.types[f"{package}/msg/{short}"]


def header(stamp_ns: int, frame: str) -> Any:
    stamp = kind("builtin_interfaces/Time")(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return kind("std_msgs/Header")(stamp=stamp, frame_id=frame)


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


NUMBERS = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
"""What PointField calls types of numbers."""


def cloud(
    stamp_ns: int, points: np.ndarray, *, frame: str = LIDAR, rows: int = 1, padding: int = 0, big: bool = False
) -> Any:
    """Return a PointCloud2 of a structured array (N,), in rows that end with so many bytes that mean nothing."""
    dtype = points.dtype.newbyteorder(">" if big else "<")
    fields = [
        kind("sensor_msgs/PointField")(name=name, offset=offset, datatype=NUMBERS[each.str[1:]], count=1)
        for name, (each, offset) in ((name, dtype.fields[name]) for name in dtype.names)
    ]
    lines = np.ascontiguousarray(points.astype(dtype)).view(np.uint8).reshape(rows, -1)
    data = np.pad(lines, ((0, 0), (0, padding)), constant_values=77)
    return kind("sensor_msgs/PointCloud2")(
        header=header(stamp_ns, frame),
        height=rows,
        width=len(points) // rows,
        fields=fields,
        is_bigendian=big,
        point_step=dtype.itemsize,
        row_step=data.shape[1],
        data=data.reshape(-1),
        is_dense=True,
    )


def no_cloud(stamp_ns: int, frame: str = LIDAR) -> Any:
    """Return a PointCloud2 as it is constructed: without points, and without fields."""
    return replace(cloud(stamp_ns, np.zeros(0, [("x", "f4")]), frame=frame), fields=[], height=0, point_step=0)


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


def camera_transform(calibration: CameraCalibration) -> Any:
    """Return the static transform of a camera, by way of a second frame."""
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
