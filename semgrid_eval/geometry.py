"""Rigid transforms in the plane and in space; `a_from_b` takes what is given in frame b to frame a."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]  # A rotation as (x, y, z, w)


@dataclass(frozen=True)
class SE2:
    """A pose in the plane: a turn by `yaw_rad` (left-positive), then a way of (x_m, y_m)."""

    x_m: float
    y_m: float
    yaw_rad: float

    def __matmul__(self, other: "SE2") -> "SE2":
        """Chain transforms: a_from_b @ b_from_c is a_from_c."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x_m = self.x_m + cosine * other.x_m - sine * other.y_m
        y_m = self.y_m + sine * other.x_m + cosine * other.y_m
        return SE2(x_m, y_m, self.yaw_rad + other.yaw_rad)

    def inverse(self) -> "SE2":
        """Return the transform back: b_from_a of a_from_b."""
        return SE2(0.0, 0.0, -self.yaw_rad) @ SE2(-self.x_m, -self.y_m, 0.0)

    def seen_from(self, other: "SE2") -> "SE2":
        """Return `other.inverse() @ self`; places are subtracted before they are turned, which keeps more digits."""
        return SE2(0.0, 0.0, -other.yaw_rad) @ SE2(self.x_m - other.x_m, self.y_m - other.y_m, self.yaw_rad)

    def apply(self, points_m: Floats) -> Floats:
        """Take points (..., 2) from frame b to frame a."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x_m, y_m = points_m[..., 0], points_m[..., 1]
        return np.stack([cosine * x_m - sine * y_m + self.x_m, sine * x_m + cosine * y_m + self.y_m], axis=-1)


@dataclass(frozen=True, eq=False)
class SE3:
    """A pose in space: `rotation` (3, 3), then a way of `translation_m` (3,)."""

    rotation: Floats
    translation_m: Floats

    @classmethod
    def from_roll_pitch_yaw(
        cls, roll_rad: float, pitch_rad: float, yaw_rad: float, translation_m: tuple[float, float, float] = (0, 0, 0)
    ) -> Self:
        """Return the paper's R = Rz(yaw) Ry(pitch) Rx(roll) at a place: positive pitch looks down, yaw left."""
        cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
        cp, sp = math.cos(pitch_rad), math.sin(pitch_rad)
        cr, sr = math.cos(roll_rad), math.sin(roll_rad)
        rotation = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
        return cls(np.array(rotation), np.array(translation_m, np.float64))

    @classmethod
    def from_quaternion(cls, quaternion: Quaternion, translation_m: tuple[float, float, float]) -> Self:
        """Return the turn of a quaternion at a place; errors as `rotation_of`."""
        return cls(rotation_of(quaternion), np.array(translation_m, np.float64))

    def __matmul__(self, other: "SE3") -> "SE3":
        """Chain transforms: a_from_b @ b_from_c is a_from_c."""
        return SE3(self.rotation @ other.rotation, self.apply(other.translation_m))

    def inverse(self) -> "SE3":
        """Return the transform back: b_from_a of a_from_b."""
        return SE3(self.rotation.T, -(self.rotation.T @ self.translation_m))

    def apply(self, points_m: Floats) -> Floats:
        """Take points (..., 3) from frame b to frame a."""
        moved: Floats = points_m @ self.rotation.T + self.translation_m
        return moved


CAMERA_FROM_OPTICAL = SE3(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.zeros(3))
"""Optical axes (right, down, forward) to the axes of a vehicle (forward, left, up)."""
_CAMERA_FROM_OPTICAL_QUATERNION = (-0.5, 0.5, -0.5, 0.5)


def optical_quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return the rotation of `SE3.from_roll_pitch_yaw(...) @ CAMERA_FROM_OPTICAL` as a quaternion.

    It is multiplied out of half angles and not taken from the matrix, so that the bytes of logs stay what they were.
    """
    turned = _product(_product(_about(2, yaw_rad), _about(1, pitch_rad)), _about(0, roll_rad))
    return _product(turned, _CAMERA_FROM_OPTICAL_QUATERNION)


def rotation_of(quaternion: Quaternion) -> Floats:
    """Return the rotation (3, 3) of a quaternion, which need not be normalised.

    Raises:
        ValueError: it is zero or not finite.
    """
    x, y, z, w = quaternion
    norm = x * x + y * y + z * z + w * w
    if not (math.isfinite(norm) and norm > 0):
        raise ValueError(f"({x:g}, {y:g}, {z:g}, {w:g}) is not a rotation")
    s = 2.0 / norm
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def yaw_of(rotation: Floats) -> float:
    """Return the heading (rad) of a rotation (3, 3): where it takes the x axis, seen along z."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def roll_pitch_yaw_of(rotation: Floats) -> tuple[float, float, float]:
    """Return the angles (rad) of a rotation (3, 3) = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll_rad = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    pitch_rad = float(-np.arcsin(np.clip(rotation[2, 0], -1.0, 1.0)))
    return roll_rad, pitch_rad, yaw_of(rotation)


def quaternion_of(rotation: Floats) -> Quaternion:
    """Return the quaternion of a rotation (3, 3), its largest part positive (Shepperd's method)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    columns = (
        (1 + a - e - i, b + d, c + g, h - f),  # each is the quaternion (x, y, z, w), times four of one of its parts
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    largest = max(range(4), key=lambda part: columns[part][part])
    x, y, z, w = columns[largest]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length


def _about(axis: int, angle_rad: float) -> Quaternion:
    x, y, z = (math.sin(angle_rad / 2) if axis == i else 0.0 for i in range(3))
    return x, y, z, math.cos(angle_rad / 2)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Multiply: the rotation by `b`, then by `a`."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
