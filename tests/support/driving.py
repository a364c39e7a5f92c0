"""Small recordings of driving, with truth, made without any files."""

from collections.abc import Iterator

import numpy as np

from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import Actor, CameraCalibration, CameraFrame, Moment, MotionSample, Pose, Recording

FRAME_NS = 58_823_529
START_NS = 1_700_000_000_123_456_789
CALIBRATION = CameraCalibration(
    fx_px=70.5,
    fy_px=70.25,
    u0_px=31.5,
    v0_px=15.75,
    baseline_m=0.21,
    x_m=1.7,
    y_m=0.1,
    z_m=1.22,
    roll_rad=0.01,
    pitch_rad=0.04,
    yaw_rad=-0.02,
)


def driving(
    *, frames: int = 6, cameras: tuple[str, ...] = ("front",), size: tuple[int, int] = (64, 32), digest: str = "d" * 16
) -> Recording:
    """Make a recording with truth; every second frame has a label, every third a colour image."""

    def moments() -> Iterator[Moment]:
        rng = np.random.default_rng(3)
        for number in range(frames):
            stamp_ns = START_NS + number * FRAME_NS
            pictures = {camera: _frame(rng, number, stamp_ns, size) for camera in cameras}
            gps = (49.1, None, 12.5) if number % 2 else (None, None, None)
            motion = (MotionSample(stamp_ns, 5.0 + number, 0.1 * number, *gps),)
            pose = Pose(stamp_ns, 3.0 * number, -2.0, 0.1 * number - 3.0)
            yield Moment(stamp_ns, pictures, motion, pose, _actors(number))

    return Recording(
        name="street",
        dataset="synthetic",
        split="val",
        calibrations=dict.fromkeys(cameras, CALIBRATION),
        source_digest=digest,
        moments=moments,
        source_files={"front_camera.json": b'{"a": 1}', "notes.bin": b"\x00\x01"},
    )


def _frame(rng: np.random.Generator, number: int, stamp_ns: int, size: tuple[int, int]) -> CameraFrame:
    shape = size[::-1]
    label = encode_gray(rng.integers(0, 34, shape, dtype=np.uint8))
    disparity = encode_gray(rng.integers(0, 1 << 15, shape).astype(np.uint16))
    return CameraFrame(
        stamp_ns,
        image_file=encode_gray(rng.integers(0, 255, shape, dtype=np.uint8)) if number % 3 == 0 else None,
        disparity_png=disparity,
        label_png=label if number % 2 == 0 else None,
        exact_label_png=encode_gray(rng.integers(0, 34, shape, dtype=np.uint8)),
        exact_disparity_png=encode_gray(rng.integers(0, 1 << 15, shape).astype(np.uint16)),
        instance_png=encode_gray(rng.integers(0, 900, shape).astype(np.uint16)),
    )


def _actors(number: int) -> tuple[Actor, ...]:
    return tuple(
        Actor(
            actor_id=300 + index,
            label_id=26,
            x_m=1.5 * index,
            y_m=-number / 3,
            yaw_rad=0.3,
            length_m=4.25,
            width_m=1.75,
            height_m=1.5,
            velocity_x_mps=3.0,
            velocity_y_mps=-0.5,
        )
        for index in range(number % 3)
    )
