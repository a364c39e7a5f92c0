"""What every source yields and every log holds: calibrated camera frames, motion samples and, truth where known."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import NamedTuple, Self

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE3, Floats, roll_pitch_yaw_of
from semgrid_eval.motion import MotionSample as MotionSample
from semgrid_eval.motion import Pose as Pose
from semgrid_eval.recording.lidar import LidarSweep


@dataclass(frozen=True)
class CameraCalibration:
    """A camera as Cityscapes describes its stereo camera.

    Focal lengths and principal point are in pixels of the source image. Position and angles place the camera in the
    ISO 8855 vehicle frame (x forward, y left, z up, origin on the ground under the rear axle); the angles are those of
    the paper's R (yaw about z, pitch about y: positive looks down, roll about x).
    """

    fx_px: float
    fy_px: float
    u0_px: float
    v0_px: float
    baseline_m: float | None  # to the right camera of the pair; None of a single camera, which has no disparity
    x_m: float
    y_m: float
    z_m: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    def __post_init__(self) -> None:
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        if self.baseline_m is None:
            del values["baseline_m"]
        for name, value in values.items():
            if not math.isfinite(value):
                raise InputError(f"{value} is not a finite number", field=name)
            if name in ("fx_px", "fy_px", "baseline_m") and value <= 0:
                raise InputError(f"{value} is not positive", field=name)

    @classmethod
    def of(cls, matrix: Floats, ego_from_optical: SE3, baseline_m: float | None) -> Self:
        """Take the numbers out of K (3, 3), or P (3, 4), and of where the optical frame is in the vehicle's."""
        ego_from_camera = ego_from_optical @ CAMERA_FROM_OPTICAL.inverse()
        fx_px, fy_px, u0_px, v0_px = (float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
        x_m, y_m, z_m = ego_from_camera.translation_m.tolist()
        roll_pitch_yaw_rad = roll_pitch_yaw_of(ego_from_camera.rotation)
        return cls(fx_px, fy_px, u0_px, v0_px, baseline_m, x_m, y_m, z_m, *roll_pitch_yaw_rad)

    @property
    def depth_disparity_m_px(self) -> float:
        """Depth times disparity, f B, of a camera that has disparity."""
        assert self.baseline_m is not None, "whoever asks has seen that it has disparity"
        return self.fx_px * self.baseline_m

    @property
    def ego_from_camera(self) -> SE3:
        """From the camera's axes (forward, left, up) to the vehicle frame."""
        place_m = (self.x_m, self.y_m, self.z_m)
        return SE3.from_roll_pitch_yaw(self.roll_rad, self.pitch_rad, self.yaw_rad, place_m)

    @property
    def ego_from_optical(self) -> SE3:
        """From the optical axes (right, down, forward) to the vehicle frame."""
        return self.ego_from_camera @ CAMERA_FROM_OPTICAL


LONGEST_ACTOR_M = 200.0
"""No actor is longer or wider; a tram of seven parts is not half as long."""


@dataclass(frozen=True)
class Actor:
    """The true box of another road user in the map frame of `Pose`; x, y is the centre of its footprint."""

    actor_id: int  # equals the instance value of its pixels
    label_id: int  # Cityscapes label id; `unlabeled` where sensors saw nothing of it at that time
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    velocity_x_mps: float
    velocity_y_mps: float

    def fault(self) -> str:
        """Say what is impossible in the box; empty where nothing is."""
        if not all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad))):
            return "is not at a finite place"
        if not (0.0 < self.length_m <= LONGEST_ACTOR_M and 0.0 < self.width_m <= LONGEST_ACTOR_M):
            return f"is {self.length_m:g} x {self.width_m:g} m; 0 to {LONGEST_ACTOR_M:g} m are allowed"
        if not all(map(math.isfinite, (self.height_m, self.velocity_x_mps, self.velocity_y_mps))):
            return "has a height or velocity that is not finite"
        return "" if self.label_id < 256 else f"has label {self.label_id}"


@dataclass(frozen=True)
class CameraFrame:
    """One moment of one camera; images are files as bytes, untouched, all of one size: PNG, or JPEG if in colour.

    Disparity is 16 bit: d_px = (p - 1) / 256 and p = 0 is invalid. All frames of a camera with a baseline have it, and
    none of a single camera, which has an image or labels. Labels are 8-bit Cityscapes label ids.
    """

    stamp_ns: int
    image_file: bytes | None
    disparity_png: bytes | None
    label_png: bytes | None
    exact_label_png: bytes | None = None  # truth: labels without the errors of a segmentation network
    exact_disparity_png: bytes | None = None  # truth: disparity of the exact depth, coded like disparity
    instance_png: bytes | None = None  # truth: 16-bit actor id of each pixel, 0 where there is no actor


@dataclass(frozen=True)
class Moment:
    """Everything a source knows of one time stamp: frames and sweeps of what saw something then, motion and truth."""

    stamp_ns: int
    cameras: dict[str, CameraFrame]
    motion: tuple[MotionSample, ...] = ()  # samples since the last moment
    pose: Pose | None = None
    actors: tuple[Actor, ...] | None = None
    sweeps: Mapping[str, LidarSweep] = field(default_factory=dict)  # by LiDAR


class Quantity(NamedTuple):
    """A number with its unit in words, `px` or `of 1` (a share)."""

    value: float
    unit: str


@dataclass(frozen=True)
class Recording:
    """One stretch of driving, streamed moment by moment."""

    name: str  # unique in its data set, a valid file name without suffix (Cityscapes: `city_sequence_frame0`)
    dataset: str  # where it comes from: `cityscapes` or `synthetic`
    split: str  # `train`, `val` or `test`
    calibrations: dict[str, CameraCalibration]  # by camera name
    source_digest: str  # digest of everything that determines the content
    moments: Callable[[], Iterator[Moment]]  # starts a new pass over the recording, in the order of time
    source_files: dict[str, bytes] = field(default_factory=dict)  # by attachment name (`front_camera.json`)
    conditions: dict[str, Quantity] = field(default_factory=dict)  # what sets it apart from others of its data set
    group: str = ""  # the town, city or drive that it belongs to, with other recordings that may depend on it
    encoded_here: bool = False  # whether this package encodes its pictures itself: others are decoded before they count
