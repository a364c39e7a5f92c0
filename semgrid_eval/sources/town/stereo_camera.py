"""A stereo camera of a recording: what it sees becomes the files of a frame, with the errors that were asked for."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import encode
from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.matching import SemiGlobalMatching
from semgrid_eval.sources.town.picture_errors import PictureErrors, Strengths
from semgrid_eval.sources.town.sensors import Camera, View
from semgrid_eval.sources.town.varied import Conditions

_SENSOR_NOISE = 2.0  # standard deviation in grey levels; without it even a clear sky would match
# Speed counts more than size here. OpenCV before 4.12 has no choice of filter and ignores it.
_FILTER, _NO_FILTER, _FILTER_UP = 19, 8, 32
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY]
_COLOUR_PNG = [*_PNG, 0, _FILTER, _NO_FILTER]
_GREY_PNG = [*_PNG, cv2.IMWRITE_PNG_STRATEGY_RLE, _FILTER, _FILTER_UP]


class StereoMatcher:
    """Semi-global matching of the pairs of one camera, as sensors expose them.

    Matching cannot see what lies left of the right image's edge, so pairs are rendered `margin_px` wider on the left,
    which the result leaves out again.
    """

    def __init__(self, camera: Camera, rng: np.random.Generator) -> None:
        self._rng = rng
        self._matching = SemiGlobalMatching(camera.calibration)
        self.margin_px = self._matching.margin_px
        wider = replace(camera.calibration, u0_px=camera.calibration.u0_px + self.margin_px)
        left = Camera(wider, camera.width_px + self.margin_px, camera.height_px)
        self.cameras = (left, right_of(left))

    def disparity_px(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Match two colour images (H, margin + W, 3) and return the disparity (H, W); 0 where there is none."""
        return self._matching.disparity_px(self._exposed(left), self._exposed(right))[:, self.margin_px :]

    def _exposed(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the grey image (H, W) of a sensor with noise of its own."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
        grey += np.float32(_SENSOR_NOISE) * self._rng.standard_normal(grey.shape, np.float32)
        return np.clip(grey, 0, 255).astype(np.uint8)


def right_of(camera: Camera) -> Camera:
    """Return the right camera of the pair whose left one this is."""
    left = camera.calibration
    x_m, y_m, z_m = left.ego_from_optical.apply(np.array([left.baseline_m, 0.0, 0.0]))
    return replace(camera, calibration=replace(left, x_m=float(x_m), y_m=float(y_m), z_m=float(z_m)))


class StereoCamera:
    """One or two cameras and their errors, which depend on those of the frames before.

    Disparity is `modelled` or `matched`; where stereo is `exact`, neither disparity nor labels have errors.
    """

    def __init__(self, conditions: Conditions, stereo: Stereo, rng: np.random.Generator) -> None:
        disparities, labels = rng.spawn(2)
        self._camera = camera = Camera(conditions.calibration, conditions.width_px, conditions.height_px)
        strengths = Strengths(conditions.disparity, conditions.label)
        self._errors = PictureErrors.begin(stereo, strengths, disparities, labels)
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
        measured, measured_px = self._errors.add(label, exact_px)
        if self._matcher is not None:
            measured_px = self._matcher.disparity_px(*(picture for _, picture in pictures))
        return CameraFrame(
            stamp_ns=stamp_ns,
            image_file=encode(image[:, margin_px:], _COLOUR_PNG),
            disparity_png=encode(coded_disparity(measured_px), _GREY_PNG),
            label_png=encode(measured, _GREY_PNG),
            exact_label_png=encode(label, _GREY_PNG),
            exact_disparity_png=encode(coded_disparity(exact_px), _GREY_PNG),
            instance_png=encode(instance, _GREY_PNG),
        )
