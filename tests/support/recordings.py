"""Small recordings of grids, made without logs."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.files import digest_value
from semgrid_eval.grids.recording import GridRecording

FRAME_NS = 58_823_529


def recording(
    grids: NDArray[np.uint8],
    *,
    name: str = "one",
    sensors: tuple[str, ...] = ("full",),
    position_m: object = None,
    actors: NDArray[np.uint8] | None = None,
) -> GridRecording:
    """Wrap grids (S, F, H, W); the vehicle stands still unless positions (F, 2) are given."""
    frames = grids.shape[1]
    return GridRecording(
        name=name,
        log=f"{name}.mcap",
        digest=digest_value(name),
        dataset="synthetic",
        split="train",
        sensors=sensors,
        target="full",
        stamps_ns=np.arange(frames, dtype=np.int64) * FRAME_NS,
        grids=grids,
        position_m=np.zeros((frames, 2)) if position_m is None else np.asarray(position_m, np.float64),
        yaw_rad=np.zeros(frames),
        actors=actors,
    )


def random_recording(
    seed: int, *, frames: int = 30, size: int = 16, sensors: tuple[str, ...] = ("full",), truth: bool = False
) -> GridRecording:
    """Make random classes on a random way, and random flags of actors where the `truth` is wanted."""
    random = np.random.default_rng(seed)
    grids = random.integers(0, CLASS_COUNT, (len(sensors), frames, size, size), dtype=np.uint8)
    position_m = np.cumsum(random.normal(0.3, 0.5, (frames, 2)), axis=0)
    actors = random.integers(0, 4, (frames, size, size), dtype=np.uint8) if truth else None
    return recording(grids, name=f"random {seed}", sensors=sensors, position_m=position_m, actors=actors)


def drifting_blocks(seed: int, *, frames: int = 12, size: int = 16) -> GridRecording:
    """Make a car that drives right over a road between buildings, seen by a vehicle that stands."""
    random = np.random.default_rng(seed)
    row, column = random.integers(4, size - 6), random.integers(0, size // 2)
    grids = np.ones((1, frames, size, size), np.uint8)
    grids[:, :, :, :2] = grids[:, :, :, -2:] = 3
    for frame in range(frames):
        grids[0, frame, row : row + 3, column + frame // 2 : column + frame // 2 + 3] = 6
    return recording(grids, name=f"blocks {seed}")
