"""Errors that vary: the camera and the strength of each error of a recording, drawn from ranges (docs/town.md)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from semgrid_eval.recording.types import CameraCalibration, Quantity
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.drives import MotionNoise
from semgrid_eval.sources.town.noise import DisparityNoise, LabelNoise
from semgrid_eval.sources.town.sensors import cityscapes_camera

_DIGITS = 6  # kept of what is drawn: processors differ in the last bits of an exponential
_NOISE_PX, _LABEL_PX = "px of an image 2048 px wide", "px of an image 512 px wide"
_OF_IMAGE, _KEPT = "of the image", "kept by the next frame"


@dataclass(frozen=True)
class Range:
    """From where to where a number is drawn, evenly or, where `by_ratio`, evenly in its logarithm."""

    low: float
    high: float
    unit: str
    by_ratio: bool = True

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a number."""
        share = float(rng.random())
        if self.by_ratio:
            return round(self.low * math.exp(share * math.log(self.high / self.low)), _DIGITS)
        return round(self.low + share * (self.high - self.low), _DIGITS)


RANGES = {
    "camera": {
        "focal_widths": Range(0.55, 1.15, "widths of the image"),
        "focal_heights": Range(1.8, 2.4, "heights of the image"),
        "depth_disparity": Range(0.20, 0.36, "m times widths of the image"),
        "z_m": Range(1.15, 1.75, "m", by_ratio=False),
        "pitch_rad": Range(-0.01, 0.05, "rad", by_ratio=False),
        "pixels": Range(0.6, 1.8, "of those asked for"),
    },
    "disparity": {
        "correlated_px": Range(0.12, 0.6, _NOISE_PX),
        "slow_px": Range(0.12, 0.6, _NOISE_PX),
        "white_px": Range(0.12, 0.6, _NOISE_PX),
        "correlation": Range(0.006, 0.02, "widths of the image"),
        "persistence": Range(0.7, 0.97, _KEPT, by_ratio=False),
        "mismatched": Range(0.003, 0.04, _OF_IMAGE),
        "mismatch_px": Range(3.0, 15.0, _NOISE_PX),
        "dropout": Range(0.005, 0.12, _OF_IMAGE),
        "far_dropout": Range(0.06, 0.4, _OF_IMAGE),
        "speckle": Range(0.002, 0.05, _OF_IMAGE),
        "fattened": Range(0.2, 0.9, "of the borders", by_ratio=False),
        "sky": Range(0.0, 0.8, "of the sky", by_ratio=False),
    },
    "label": {
        "warp_px": Range(0.2, 1.0, _LABEL_PX),
        "border_px": Range(1.0, 4.0, _LABEL_PX),
        "bad_borders": Range(0.03, 0.3, _OF_IMAGE),
        "confused_px": Range(5.0, 16.0, _LABEL_PX),
        "confused": Range(0.001, 0.02, _OF_IMAGE),
        "mistaken": Range(0.2, 3.0, "of the shares in noise.py"),
        "persistence": Range(0.4, 0.9, _KEPT, by_ratio=False),
        "mistakes_persistence": Range(0.7, 0.97, _KEPT, by_ratio=False),
    },
    "motion": {
        "speed_scale": Range(0.001, 0.012, "of the speed"),
        "speed_mps": Range(0.005, 0.06, "m/s"),
        "yaw_rate_bias_radps": Range(0.0002, 0.004, "rad/s"),
        "yaw_rate_radps": Range(0.0005, 0.006, "rad/s"),
        "latency_s": Range(0.0, 0.06, "s", by_ratio=False),
    },
}
"""By what is drawn for, and its name there; the reason of each is in docs/town.md."""
_PARTS: dict[Stereo, tuple[str, ...]] = {
    "modelled": ("disparity", "label", "motion"),
    "matched": ("label", "motion"),
    "exact": (),
}
"""Whose errors are drawn, by where disparity comes from."""
_CAMERA_UNITS = {"fx_px": "px", "fy_px": "px", "baseline_m": "m", "z_m": "m", "pitch_rad": "rad"}


@dataclass(frozen=True)
class Conditions:
    """The camera of a recording, and how strong each kind of its errors is."""

    calibration: CameraCalibration
    width_px: int  # of the images
    height_px: int  # of the images
    disparity: DisparityNoise
    label: LabelNoise
    motion: MotionNoise

    @property
    def side_slope(self) -> float:
        """How far aside the camera sees, on its wider side, for each metre ahead."""
        u0_px = self.calibration.u0_px + 0.5
        return max(u0_px, self.width_px - u0_px) / self.calibration.fx_px

    def quantities(self, stereo: Stereo) -> dict[str, Quantity]:
        """Return by name what may differ between recordings of this stereo."""
        found = {"camera.width_px": Quantity(self.width_px, "px"), "camera.height_px": Quantity(self.height_px, "px")}
        for name, unit in _CAMERA_UNITS.items():
            found[f"camera.{name}"] = Quantity(getattr(self.calibration, name), unit)
        for part in _PARTS[stereo]:
            for name, drawn_from in RANGES[part].items():
                found[f"{part}.{name}"] = Quantity(getattr(getattr(self, part), name), drawn_from.unit)
        return found


def fixed_conditions(width_px: int, height_px: int) -> Conditions:
    """Return what holds where recordings do not vary: Cityscapes' camera, and the usual strength of each error."""
    camera = cityscapes_camera(width_px, height_px)
    return Conditions(camera, width_px, height_px, DisparityNoise(), LabelNoise(), MotionNoise())


def draw_conditions(width_px: int, height_px: int, rng: np.random.Generator) -> Conditions:
    """Draw the conditions of a recording; the size that was asked for says how many pixels its images have about."""
    drawn = {part: {name: each.draw(rng) for name, each in ranges.items()} for part, ranges in RANGES.items()}
    calibration, width, height = _camera(drawn["camera"], width_px * height_px)
    errors = (DisparityNoise(**drawn["disparity"]), LabelNoise(**drawn["label"]), MotionNoise(**drawn["motion"]))
    return Conditions(calibration, width, height, *errors)


def _camera(drawn: Mapping[str, float], pixels: int) -> tuple[CameraCalibration, int, int]:
    """Return a camera with square pixels and the width and height of its images.

    It stands and points like Cityscapes' but for what is drawn.
    """
    aspect = drawn["focal_heights"] / drawn["focal_widths"]
    width = round(math.sqrt(pixels * drawn["pixels"] * aspect))
    height = round(width / aspect)
    focal_px = drawn["focal_widths"] * width
    calibration = replace(
        cityscapes_camera(width, height),
        fx_px=focal_px,
        fy_px=focal_px,
        baseline_m=round(drawn["depth_disparity"] / drawn["focal_widths"], _DIGITS),
        z_m=drawn["z_m"],
        pitch_rad=drawn["pitch_rad"],
    )
    return calibration, width, height
