"""Camera geometry: from pixels with disparity to points in the vehicle frame (paper, eq. 2; readings 14 and 15)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.types import CameraCalibration

Floats = NDArray[np.float64]

VEHICLE_AXES_FROM_OPTICAL_AXES: Floats = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""(right, down, forward) becomes (forward, left, up)."""


@dataclass(frozen=True)
class GroundRays:
    """Where the pixels of one camera look: a point of depth Z lies at `origin_m + Z * slope`, in the vehicle frame.

    Args:
        origin_m: (2,) camera position, forward and left.
        slope: (2, H, W) forward and left metres for each metre of depth along the optical axis.
        depth_disparity_m_px: depth times disparity, fx * baseline at the disparity's own resolution.
    """

    origin_m: Floats
    slope: Floats
    depth_disparity_m_px: float


def ego_from_camera(calibration: CameraCalibration) -> Floats:
    """Return the paper's R (3, 3) = Rz(yaw) Ry(pitch) Rx(roll): camera axes (forward, left, up) to vehicle axes."""
    cy, sy = math.cos(calibration.yaw_rad), math.sin(calibration.yaw_rad)
    cp, sp = math.cos(calibration.pitch_rad), math.sin(calibration.pitch_rad)
    cr, sr = math.cos(calibration.roll_rad), math.sin(calibration.roll_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def ground_rays(
    calibration: CameraCalibration, source_size_px: tuple[int, int], image_size_px: tuple[int, int]
) -> GroundRays:
    """Compute the rays of all pixels of the resized image.

    Args:
        calibration: in pixels of the source image.
        source_size_px: width and height of the source image.
        image_size_px: width and height after resizing; K is scaled with half-pixel centres.
    """
    width, height = image_size_px
    scale_u, scale_v = width / source_size_px[0], height / source_size_px[1]
    u = np.arange(width) - ((calibration.u0_px + 0.5) * scale_u - 0.5)
    v = np.arange(height) - ((calibration.v0_px + 0.5) * scale_v - 0.5)
    optical = np.empty((3, height, width))
    optical[0] = (u / (calibration.fx_px * scale_u))[None, :]
    optical[1] = (v / (calibration.fy_px * scale_v))[:, None]
    optical[2] = 1.0
    rotation = ego_from_camera(calibration) @ VEHICLE_AXES_FROM_OPTICAL_AXES
    slope = np.tensordot(rotation[:2], optical, axes=1)
    origin_m = np.array([calibration.x_m, calibration.y_m])
    return GroundRays(origin_m, np.ascontiguousarray(slope), calibration.fx_px * calibration.baseline_m)


def unit_projection(calibration: CameraCalibration, size_px: tuple[int, int]) -> Floats:
    """Return the projection (3, 4) of points in the vehicle frame, (x, y, z, 1), to an image whose sides are 1 long.

    It gives (w u, w v, w): u is 0 at the left edge and 1 at the right one, v at the upper and the lower one, w is the
    depth in metres; what has w <= 0 lies behind the camera.

    Args:
        calibration: in pixels of the source image.
        size_px: width and height of the source image.
    """
    width, height = size_px
    camera_matrix = np.array(
        [
            [calibration.fx_px / width, 0.0, (calibration.u0_px + 0.5) / width],
            [0.0, calibration.fy_px / height, (calibration.v0_px + 0.5) / height],
            [0.0, 0.0, 1.0],
        ]
    )
    optical_from_ego = (ego_from_camera(calibration) @ VEHICLE_AXES_FROM_OPTICAL_AXES).T
    position_m = np.array([calibration.x_m, calibration.y_m, calibration.z_m])
    return np.hstack([camera_matrix @ optical_from_ego, -(camera_matrix @ optical_from_ego @ position_m)[:, None]])


def nearest_indices(source: int, target: int) -> NDArray[np.intp]:
    """Return, for each of `target` pixels, the nearest of `source` pixels along one axis (half-pixel centres)."""
    return ((np.arange(target) + 0.5) * source / target).astype(np.intp)
