"""Which cells of a grid lie on ground that the camera sees, but no sensor of the inputs does."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.grids.spec import GridConfig, GridSpec, Sensor
from semgrid_eval.scores.results import WindowRecord
from semgrid_eval.scores.thumbnails import Drive

Flags = NDArray[np.bool_]


def blind_cells(drive: Drive, grid: GridConfig, sensors: Sequence[str], window: WindowRecord) -> Flags | None:
    """Flag the blind cells of a window in the target's place: (H, W).

    The ground is taken as flat, so this says where ground is seen, not how far walls and cars reach into view.

    Args:
        drive: of the window's log.
        grid: how its grids were made.
        sensors: names of the input sensors.
        window: tells the times of target and inputs.

    Returns:
        None where the times of inputs are not known or not those of frames.
    """
    crops = {sensor.name: sensor for sensor in grid.all_sensors()}
    place = {int(stamp): frame for frame, stamp in enumerate(drive.track_ns)}
    stamps = (window.target_stamp_ns, *window.input_stamps_ns)
    if len(stamps) < 2 or not all(stamp in place for stamp in stamps) or not all(name in crops for name in sensors):
        return None
    target, *inputs = (place[stamp] for stamp in stamps)
    first = max(0, target - window.target_frame)  # of the stretch whose orientation the grids have
    ground_m = _cell_centres_odom(grid.spec, drive.track[target], float(drive.track[first, 2]))
    seen, covered = np.zeros(ground_m.shape[:2], np.bool_), np.zeros(ground_m.shape[:2], np.bool_)
    for frame in inputs:
        u, v = _image_places(drive.projection, ground_m, drive.track[frame])
        seen |= (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
        for name in sensors:
            covered |= _inside(crops[name], grid.image_size_px, u, v)
    return seen & ~covered


def _cell_centres_odom(spec: GridSpec, pose: NDArray[np.float64], yaw_rad: float) -> NDArray[np.float64]:
    """Return the centres of the cells of a grid around a pose, in the odom frame: (H, W, 2)."""
    forward_m, left_m = np.meshgrid(*spec.centres_m(), indexing="ij")
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    x_m, y_m = cosine * forward_m - sine * left_m, sine * forward_m + cosine * left_m
    return np.stack([x_m, y_m], axis=-1) + pose[:2]


def _image_places(
    projection: NDArray[np.float64], ground_m: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project points of the ground to the image seen from a pose, u and v (H, W) from 0 to 1; NaN behind the camera."""
    x_m, y_m = np.moveaxis(ground_m - pose[:2], -1, 0)
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    ego_m = np.stack([cosine * x_m + sine * y_m, cosine * y_m - sine * x_m], axis=-1)
    across, down, depth_m = np.moveaxis(ego_m @ projection[:, :2].T + projection[:, 3], -1, 0)
    depth_m = np.where(depth_m > 0, depth_m, np.nan)
    return across / depth_m, down / depth_m


def _inside(sensor: Sensor, size_px: tuple[int, int], u: NDArray[np.float64], v: NDArray[np.float64]) -> Flags:
    width, height = size_px
    across = (u * width >= sensor.left_px) & (u * width < sensor.right_px)
    return across & (v * height >= sensor.top_px) & (v * height < sensor.bottom_px)
