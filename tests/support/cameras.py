"""Cameras of tests, and what a camera does, step by step."""

import math

from semgrid_eval.recording.types import CameraCalibration


def calibration(**changes) -> CameraCalibration:
    values = {
        "fx_px": 565.0,
        "fy_px": 566.0,
        "u0_px": 273.5,
        "v0_px": 128.2,
        "baseline_m": 0.209,
        "x_m": 1.7,
        "y_m": 0.1,
        "z_m": 1.22,
        "roll_rad": 0.0,
        "pitch_rad": 0.0,
        "yaw_rad": 0.0,
    }
    return CameraCalibration(**{**values, **changes})


def slow_point(camera: CameraCalibration, u: float, v: float, depth_m: float) -> list[float]:
    """Undo the camera step by step: pixel, optical axes, forward-left-up axes, roll, pitch, yaw, translation."""
    right = (u - camera.u0_px) / camera.fx_px * depth_m
    down = (v - camera.v0_px) / camera.fy_px * depth_m
    x, y, z = depth_m, -right, -down
    c, s = math.cos(camera.roll_rad), math.sin(camera.roll_rad)
    y, z = c * y - s * z, s * y + c * z
    c, s = math.cos(camera.pitch_rad), math.sin(camera.pitch_rad)
    x, z = c * x + s * z, -s * x + c * z
    c, s = math.cos(camera.yaw_rad), math.sin(camera.yaw_rad)
    x, y = c * x - s * y, s * x + c * y
    return [x + camera.x_m, y + camera.y_m]
