"""Which cells of a grid lie on ground that the camera sees, but no sensor of the inputs does."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import SE2
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.scores.results import WindowRecord
from semgrid_eval.scores.thumbnails import Track
from semgrid_eval.sensors.camera import CameraSensor

Flags = NDArray[np.bool_]


def blind_cells(track: Track, grid: GridConfig, sensors: Sequence[str], window: WindowRecord) -> Flags | None:
    """Flag the blind cells of a window in the target's place: (H, W).

    The ground is taken as flat, so this says where ground is seen, not how far walls and cars reach into view.

    Returns:
        None where an input sensor is not a part of the shown camera's image, or inputs have other times than frames.
    """
    parts = parts_of_shown(grid)
    place = {int(stamp): frame for frame, stamp in enumerate(track.stamps_ns)}
    stamps = (window.target_stamp_ns, *window.input_stamps_ns)
    if not all(stamp in place for stamp in stamps) or not all(name in parts for name in sensors):
        return None
    target, *inputs = (place[stamp] for stamp in stamps)
    first = max(0, target - window.target_frame)  # of the stretch whose orientation the grids have
    poses = [SE2(*pose) for pose in track.poses.tolist()]
    grid_pose = SE2(poses[target].x_m, poses[target].y_m, poses[first].yaw_rad)
    ground_m = grid_pose.apply(np.stack(np.meshgrid(*grid.spec.centres_m(), indexing="ij"), axis=-1))  # (H, W, 2)
    seen, covered = np.zeros(ground_m.shape[:2], np.bool_), np.zeros(ground_m.shape[:2], np.bool_)
    for frame in inputs:
        u, v = _image_places(track.projection, poses[frame].inverse().apply(ground_m))
        seen |= (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
        for name in sensors:
            covered |= _inside(parts[name], u, v)
    return seen & ~covered


def parts_of_shown(grid: GridConfig) -> dict[str, CameraSensor]:
    """Return the sensors that are parts of the image of the camera that leads the target, which a run keeps."""
    cameras = {name: sensor for name, sensor in grid.sensors.items() if isinstance(sensor, CameraSensor)}
    return {name: sensor for name, sensor in cameras.items() if grid.camera and sensor.shares_image_with(grid.camera)}


def _image_places(
    projection: NDArray[np.float64], ego_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project points of the ground (H, W, 2) to the image, u and v (H, W) from 0 to 1; NaN behind the camera."""
    across, down, depth_m = np.moveaxis(ego_m @ projection[:, :2].T + projection[:, 3], -1, 0)
    depth_m = np.where(depth_m > 0, depth_m, np.nan)
    return across / depth_m, down / depth_m


def _inside(part: CameraSensor, u: NDArray[np.float64], v: NDArray[np.float64]) -> Flags:
    (width, height), (top, bottom, left, right) = part.image_size_px, part.crop_px
    return (u * width >= left) & (u * width < right) & (v * height >= top) & (v * height < bottom)
