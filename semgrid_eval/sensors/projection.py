"""Camera geometry: from pixels with disparity to points in the vehicle frame (paper, eq. 2; readings 14 and 15)."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import NO_POINT
from semgrid_eval.recording.resizing import nearest_indices
from semgrid_eval.recording.types import CameraCalibration
from semgrid_eval.sensors.exclusion import ALL_PIXELS, Exclusion

Floats = NDArray[np.float64]
Ids = NDArray[np.uint8]
Image = NDArray[np.uint8] | NDArray[np.uint16]
_Sides = tuple[NDArray[np.intp], NDArray[np.intp]]


class Pixels(NamedTuple):
    """The points of an image's pixels, metres forward and left in the vehicle frame and grid classes, all (H, W)."""

    forward_m: Floats
    left_m: Floats
    class_id: Ids


class Projection:
    """Turns the pixels of one camera's images into points, at one size.

    Args:
        calibration: in pixels of the source image.
        size_px: width and height to which images are brought.
        class_by_label: (256,) grid class of each label id, `NO_POINT` for none.
        exclusion: which pixels of the images at that size give no point.
    """

    def __init__(
        self,
        calibration: CameraCalibration,
        size_px: tuple[int, int],
        class_by_label: Ids,
        exclusion: Exclusion = ALL_PIXELS,
    ) -> None:
        self._calibration, self._size_px, self._class_by_label = calibration, size_px, class_by_label
        self._exclusion = exclusion
        self._slopes: dict[tuple[int, ...], Floats] = {}
        self._origin_m = np.array([calibration.x_m, calibration.y_m])
        self._depth_disparity_m_px = calibration.depth_disparity_m_px  # at the disparity's own resolution

    def points(self, disparity: Image, label: Image) -> Pixels:
        """Project source images (h, w).

        Args:
            disparity: 16 bit, d_px = (p - 1) / 256; 0 is invalid, 1 at infinity.
            label: label ids.
        """
        width, height = self._size_px
        forward_m, left_m = np.empty((height, width)), np.empty((height, width))
        class_id = np.empty((height, width), np.uint8)
        shape = disparity.shape
        if shape not in self._slopes:
            self._slopes[shape] = ground_slope(self._calibration, (shape[1], shape[0]), self._size_px)
        _project(
            (disparity, *self._sides(shape)),
            (label, *self._sides(label.shape)),
            self._class_by_label,
            (self._slopes[shape], self._origin_m, self._depth_disparity_m_px),
            (forward_m, left_m, class_id),
        )
        if self._exclusion:
            classes = self._class_by_label[self._resized(label)]
            source_px = shape[1] / self._size_px[0]
            class_id[self._exclusion.mask(classes, self._resized(disparity), source_px)] = NO_POINT
        return Pixels(forward_m, left_m, class_id)

    def _resized(self, image: Image) -> Image:
        rows, columns = self._sides(image.shape)
        return image.take(rows, axis=0).take(columns, axis=1)

    def _sides(self, shape: tuple[int, ...]) -> _Sides:
        width, height = self._size_px
        return nearest_indices(shape[0], height), nearest_indices(shape[1], width)


def ground_slope(
    calibration: CameraCalibration, source_size_px: tuple[int, int], image_size_px: tuple[int, int]
) -> Floats:
    """Return the metres forward and left (2, H, W) for each metre of depth along the optical axis, by pixel.

    A point of depth Z lies at the camera's place + Z * slope, in the vehicle frame. Sizes are width and height of the
    source image and after resizing; K is scaled with half-pixel centres.
    """
    width, height = image_size_px
    scale_u, scale_v = width / source_size_px[0], height / source_size_px[1]
    u = np.arange(width) - ((calibration.u0_px + 0.5) * scale_u - 0.5)
    v = np.arange(height) - ((calibration.v0_px + 0.5) * scale_v - 0.5)
    optical = np.empty((3, height, width))
    optical[0] = (u / (calibration.fx_px * scale_u))[None, :]
    optical[1] = (v / (calibration.fy_px * scale_v))[:, None]
    optical[2] = 1.0
    slope: Floats = np.tensordot(calibration.ego_from_optical.rotation[:2], optical, axes=1)
    return np.ascontiguousarray(slope)


def unit_projection(calibration: CameraCalibration, size_px: tuple[int, int]) -> Floats:
    """Return the projection (3, 4) of points in the vehicle frame, (x, y, z, 1), to an image whose sides are 1 long.

    It gives (w u, w v, w): u is 0 at the left edge and 1 at the right one, v at the upper and the lower one, w is the
    depth in metres; what has w <= 0 lies behind the camera. `size_px` are width and height of the source image.
    """
    width, height = size_px
    camera_matrix = np.array(
        [
            [calibration.fx_px / width, 0.0, (calibration.u0_px + 0.5) / width],
            [0.0, calibration.fy_px / height, (calibration.v0_px + 0.5) / height],
            [0.0, 0.0, 1.0],
        ]
    )
    optical_from_ego = calibration.ego_from_optical.inverse()
    return camera_matrix @ np.column_stack([optical_from_ego.rotation, optical_from_ego.translation_m])


@numba.njit(cache=True, nogil=True)
def _project(disparities, labels, class_by_label, rays, points):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    disparity, disparity_rows, disparity_columns = disparities
    label, label_rows, label_columns = labels
    slope, origin_m, depth_disparity = rays
    forward_m, left_m, class_id = points
    for v in range(forward_m.shape[0]):
        for u in range(forward_m.shape[1]):
            known = class_by_label[label[label_rows[v], label_columns[u]]]
            value = disparity[disparity_rows[v], disparity_columns[u]]
            if value <= 1:  # 0 is invalid, 1 is at infinity
                known = NO_POINT
            class_id[v, u] = known
            if known != NO_POINT:
                depth_m = depth_disparity * 256.0 / (value - 1.0)
                forward_m[v, u] = origin_m[0] + depth_m * slope[0, v, u]
                left_m[v, u] = origin_m[1] + depth_m * slope[1, v, u]
