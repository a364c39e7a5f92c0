"""The camera of a recording: what it sees becomes the files of a frame, with the errors that were asked for."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sources.town.matching import StereoMatcher
from semgrid_eval.sources.town.noise import DisparityErrors, DisparityNoise, LabelErrors, LabelNoise
from semgrid_eval.sources.town.sensors import Camera, View

# Speed counts more than size here. OpenCV before 4.12 has no choice of filter and ignores it.
_FILTER, _NO_FILTER, _FILTER_UP = 19, 8, 32
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY]
_COLOUR_PNG = [*_PNG, 0, _FILTER, _NO_FILTER]
_GREY_PNG = [*_PNG, cv2.IMWRITE_PNG_STRATEGY_RLE, _FILTER, _FILTER_UP]


class Rig:
    """One or two cameras and their errors, which depend on those of the frames before.

    Disparity is `modelled` or `matched`; where stereo is `exact`, neither disparity nor labels have errors.
    """

    def __init__(self, camera: Camera, stereo: str, rng: np.random.Generator) -> None:
        disparities, labels = rng.spawn(2)
        self._camera = camera
        self._labels = None if stereo == "exact" else LabelErrors(LabelNoise(), labels)
        self._errors = DisparityErrors(DisparityNoise(), disparities) if stereo == "modelled" else None
        self._matcher = StereoMatcher(camera, disparities) if stereo == "matched" else None

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The cameras whose pictures `frame` wants."""
        return (self._camera,) if self._matcher is None else self._matcher.cameras

    def frame(self, stamp_ns: int, pictures: Sequence[tuple[View, NDArray[np.uint8]]]) -> CameraFrame:
        """Turn what the cameras see, and their colour images (H, W, 3), into the next frame."""
        view, image = pictures[0]
        margin_px = self.cameras[0].width_px - self._camera.width_px
        shape = image.shape[:2]
        label, instance = view.label.reshape(shape)[:, margin_px:], view.instance.reshape(shape)[:, margin_px:]
        exact_px = self._camera.disparity_px(view.depth_m.reshape(shape)[:, margin_px:])
        measured_px = self._measured(exact_px, [picture for _, picture in pictures])
        return CameraFrame(
            stamp_ns=stamp_ns,
            image_png=_png(image[:, margin_px:], _COLOUR_PNG),
            disparity_png=_png(coded_disparity(measured_px), _GREY_PNG),
            label_png=_png(self._labels.add(label) if self._labels else label, _GREY_PNG),
            exact_label_png=_png(label, _GREY_PNG),
            exact_disparity_png=_png(coded_disparity(exact_px), _GREY_PNG),
            instance_png=_png(instance, _GREY_PNG),
        )

    def _measured(self, exact_px: NDArray[np.float32], images: list[NDArray[np.uint8]]) -> NDArray[np.float32]:
        if self._matcher is not None:
            return self._matcher.disparity_px(*images)
        return exact_px if self._errors is None else self._errors.add(exact_px)


def coded_disparity(disparity_px: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Code disparities (H, W) as Cityscapes does: p = 256 d + 1, and 0 for what is not positive or too large."""
    coded = np.rint(disparity_px * np.float32(256.0)) + np.float32(1.0)
    return np.where((disparity_px > 0.0) & (coded <= 65535.0), coded, 0.0).astype(np.uint16)


def _png(image: NDArray[np.uint8] | NDArray[np.uint16], parameters: list[int]) -> bytes:
    done, data = cv2.imencode(".png", image, parameters)
    assert done, "OpenCV encodes every 8 or 16 bit image"
    return data.tobytes()
