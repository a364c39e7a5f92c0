"""Labels of a LiDAR's points by the label images of cameras that see them."""

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import LogError, located
from semgrid_eval.log.topics import LABEL, camera_topic
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sensors.projection import unit_projection

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader
    from semgrid_eval.recording.types import CameraCalibration, CameraFrame
    from semgrid_eval.sensors.lidar import ColourFrom

_BEHIND = 0.15
"""What is farther than the nearest point beside it by more than this share of its own distance is hidden by it."""
_NS_PER_S = 1e9
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Coloured:
    """Label ids of points, and whether a camera sees them at all: both (N,)."""

    label_id: NDArray[np.uint8]
    seen: Flags

    def over(self, other: "Coloured") -> "Coloured":
        """Return the same, with what another camera sees beside it."""
        return Coloured(np.where(self.seen, self.label_id, other.label_id), self.seen | other.seen)


class Colouring:
    """Gives the points of one LiDAR, sweep after sweep in the order of time, the labels of cameras' pixels.

    A point has the label of the first camera that sees it; errors are those of `CameraColouring`.
    """

    def __init__(self, log: "LogReader", settings: "ColourFrom") -> None:
        motion = EgoMotion(log.motion(), "arc")
        self._cameras = [CameraColouring(log, camera, settings, motion) for camera in settings.cameras]

    def colour(self, stamp_ns: int, place_m: Floats) -> Coloured:
        """Colour points (N, 3) in the vehicle frame of a time."""
        return reduce(Coloured.over, (each.colour(stamp_ns, place_m) for each in self._cameras))


class CameraColouring:
    """Gives points the labels of one camera's pixels.

    Points are moved by the vehicle's motion to the time of the label image that is nearest to their sweep, of two that
    are equally near the earlier. What moves itself is not where it was then.

    Raises:
        LogError: there is no such camera, a label image is missing or damaged.
    """

    def __init__(self, log: "LogReader", camera: str | None, settings: "ColourFrom", motion: EgoMotion) -> None:
        self._path, self._settings = log.path, settings
        self._camera = log.choose_camera(camera)
        self._calibration, self._size_px = log.calibration(self._camera), log.image_size(self._camera)
        self._projection = unit_projection(self._calibration, self._size_px)
        self._motion = motion
        self._frames = log.frames(self._camera)
        self._nearest, self._next = next(self._frames, None), next(self._frames, None)

    def colour(self, stamp_ns: int, place_m: Floats) -> Coloured:
        """Colour points (N, 3) in the vehicle frame of a time."""
        frame = self._frame_at(stamp_ns)
        if frame is None:
            return Coloured(np.zeros(len(place_m), np.uint8), np.zeros(len(place_m), np.bool_))
        label = self._label_image(frame)
        pixels = PointPixels.of(self._projected(frame, stamp_ns, place_m), label.shape)
        seen = pixels.inside.copy()
        beside_px = reach_px(self._settings.occlusion_rad, self._calibration, self._size_px, label.shape)
        seen[pixels.inside] = ~pixels.hidden(label.shape, beside_px)
        found = np.zeros(len(place_m), np.uint8)
        found[pixels.inside] = label[pixels.row, pixels.column]
        return Coloured(found, seen)

    def _frame_at(self, stamp_ns: int) -> "CameraFrame | None":
        """Return the nearest frame, None where there is none in time."""
        if self._nearest is None:
            return None
        while self._next is not None and abs(self._next.stamp_ns - stamp_ns) < abs(self._nearest.stamp_ns - stamp_ns):
            self._nearest, self._next = self._next, next(self._frames, None)
        apart_ns = abs(self._nearest.stamp_ns - stamp_ns)
        return self._nearest if apart_ns <= self._settings.within_s * _NS_PER_S else None

    def _label_image(self, frame: "CameraFrame") -> NDArray[np.generic]:
        if not frame.label_png:
            place = f"frame of {self._camera} at {frame.stamp_ns} ns"
            message = "has no label image to colour points by; `semgrid-eval segment` adds them"
            raise LogError(message, path=self._path, field=place)
        place = f"{camera_topic(self._camera, LABEL)} at {frame.stamp_ns} ns"
        with located(field=place, path=self._path, kind=LogError):
            return decode_gray(frame.label_png, bit_depth=8)

    def _projected(self, frame: "CameraFrame", stamp_ns: int, place_m: Floats) -> Floats:
        """Return u, v in images whose sides are 1 long, times depth, and depth (m): (3, N)."""
        now, then = (self._motion.odom_from_vehicle(each) for each in (stamp_ns, frame.stamp_ns))
        moved_m = now.seen_from(then).apply(place_m[:, :2])
        points = np.column_stack([moved_m, place_m[:, 2], np.ones(len(place_m))])
        return np.asarray(self._projection @ points.T, np.float64)


def reach_px(
    angle_rad: float, calibration: "CameraCalibration", size_px: tuple[int, int], shape: tuple[int, ...]
) -> tuple[int, int]:
    """Return how many rows and columns of an image (H, W) an angle spans in its middle, at most all of them.

    `size_px` are width and height of the source image, for which the camera is calibrated.
    """
    width, height = size_px
    rows, columns = angle_rad * calibration.fy_px / height, angle_rad * calibration.fx_px / width
    return round(min(rows, 1.0) * shape[0]), round(min(columns, 1.0) * shape[1])


@dataclass(frozen=True)
class PointPixels:
    """Where points are in an image: which are inside (N,), and of these (M,) the pixel and the depth."""

    inside: Flags
    row: NDArray[np.intp]
    column: NDArray[np.intp]
    depth_m: NDArray[np.float32]

    @classmethod
    def of(cls, projected: Floats, shape: tuple[int, ...]) -> "PointPixels":
        """Find the pixels of points (3, N), as `unit_projection` gives them, in an image (H, W)."""
        depth_m = projected[2]
        inside = depth_m > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            column, row = projected[0] / depth_m * shape[1], projected[1] / depth_m * shape[0]
        inside &= (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
        row, column = row[inside].astype(np.intp), column[inside].astype(np.intp)
        return cls(inside, row, column, depth_m[inside].astype(np.float32))

    def hidden(self, shape: tuple[int, ...], reach_px: tuple[int, int]) -> Flags:
        """Tell which points (M,) have a much nearer one at most `reach_px` rows and columns away.

        A LiDAR above the camera sees over what the camera sees; there the pixel shows what stands before.
        """
        nearest_m = np.full(shape, np.inf, np.float32)
        np.minimum.at(nearest_m, (self.row, self.column), self.depth_m)
        beside = np.ones((2 * reach_px[0] + 1, 2 * reach_px[1] + 1), np.uint8)
        nearest_m = np.asarray(cv2.erode(nearest_m, beside), np.float32)
        return np.asarray(nearest_m[self.row, self.column] < (1 - _BEHIND) * self.depth_m)
