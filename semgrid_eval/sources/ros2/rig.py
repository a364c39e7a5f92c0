"""One camera of a bag: its calibration, and frames of the log made of its messages."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, located
from semgrid_eval.geometry import CAMERA_FROM_OPTICAL
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.disparity import LARGEST_PX, coded_disparity
from semgrid_eval.recording.png import encode, encode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.matching import SemiGlobalMatching
from semgrid_eval.sources.rectification import baseline_m
from semgrid_eval.sources.ros2 import pictures
from semgrid_eval.sources.ros2.cameras import Info, rectification_of
from semgrid_eval.sources.ros2.labels import LabelTable
from semgrid_eval.sources.ros2.mapping import CameraMap, VehicleMap
from semgrid_eval.sources.ros2.scan import Facts

_FOCAL_SHARE, _BASELINE_SHARE = 1e-3, 1e-2  # by which a DisparityImage may differ from the calibration
Disparity = NDArray[np.float32]


@dataclass(frozen=True)
class RigPlan:
    """What turns the messages of one camera into frames; it travels to another process."""

    camera: CameraMap
    calibration: CameraCalibration
    info: Info
    right_info: Info | None

    def described(self) -> list[Any]:
        """Return as JSON what determines the frames, but for the messages."""
        infos = [None if each is None else asdict(each) for each in (self.info, self.right_info)]
        return [self.camera.model_dump(mode="json"), asdict(self.calibration), *infos]


def plan_rig(camera: CameraMap, vehicle: VehicleMap, facts: Facts) -> RigPlan:
    """Work out the calibration of a camera.

    Raises:
        InputError: it is missing, impossible, of another image size or contradicts a DisparityImage; or nothing links
            the camera to the vehicle.
    """
    info = facts.infos[camera.info]
    right_info = None if camera.right_info is None else facts.infos[camera.right_info]
    for what, topic in camera.pictures().items():
        is_right = what == "right"
        _require_size(
            facts, topic, right_info or info if is_right else info, camera.right_info if is_right else camera.info
        )
    with located(field=camera.info):
        projection = info.projection(rectified=camera.rectified)
        baseline = _baseline(camera, facts, projection, right_info)
    calibration = _calibration(camera, vehicle, facts, projection, baseline)
    if camera.disparity is not None:
        _require_agreement(facts, camera.disparity, calibration)
    return RigPlan(camera, calibration, info, right_info)


class Rig:
    """Makes the frames of one camera."""

    def __init__(self, plan: RigPlan) -> None:
        self._camera, self._calibration = plan.camera, plan.calibration
        self._left = rectification_of(plan.info, rectified=plan.camera.rectified)
        self._labels = LabelTable(plan.camera.ids)
        if plan.right_info is not None and plan.camera.right is not None:
            self._right = rectification_of(plan.right_info, rectified=plan.camera.rectified)
            self._matching = SemiGlobalMatching(plan.calibration)
            left, right = (each.projection(rectified=plan.camera.rectified) for each in (plan.info, plan.right_info))
            self._shift_px = float(left[0, 2] - right[0, 2])  # what is infinitely far has this disparity

    def frame(self, stamp_ns: int, messages: Mapping[str, Any]) -> CameraFrame:
        """Make the frame of the messages of its pictures, by what they are."""
        image, labels = messages.get("image"), messages.get("labels")
        return CameraFrame(
            stamp_ns=stamp_ns,
            image_file=None if image is None else self._image(image),
            disparity_png=None if self._camera.is_single else self._disparity_png(messages),
            label_png=None if labels is None else self._label_png(labels),
        )

    def _image(self, message: Any) -> bytes:  # noqa: ANN401 - a class that rosbags makes
        if not self._left.changes:
            return pictures.colour_file(message)
        return encode(self._left.apply(pictures.colour(message), "bilinear"))

    def _label_png(self, message: Any) -> bytes:  # noqa: ANN401
        return encode_gray(self._labels.label_ids(self._left.apply(pictures.ids_of(message), "nearest")))

    def _disparity_png(self, messages: Mapping[str, Any]) -> bytes:
        return encode_gray(coded_disparity(self._disparity_px(messages)))

    def _disparity_px(self, messages: Mapping[str, Any]) -> Disparity:
        """Return the disparity (H, W); 0 where there is none."""
        if "disparity" in messages:
            return _told_px(messages["disparity"])
        if "depth" in messages:
            depth_m = self._left.apply(pictures.depth_m(messages["depth"]), "nearest")
            return depth_as_disparity_px(depth_m, self._calibration)
        left = self._left.apply(pictures.gray(pictures.colour(messages["image"])), "bilinear")
        right = self._right.apply(pictures.gray(pictures.colour(messages["right"])), "bilinear")
        matched_px = self._matching.disparity_px(left, right)
        return np.where(matched_px > 0, matched_px - np.float32(self._shift_px), np.float32(0))


def depth_as_disparity_px(depth_m: Disparity, calibration: CameraCalibration) -> Disparity:
    """Return d = f B / Z of a depth image (H, W); 0 where there is no depth, or one too small to be coded."""
    depth_px = np.float32(calibration.depth_disparity_m_px)
    known = np.isfinite(depth_m) & (depth_m >= depth_px / np.float32(LARGEST_PX))
    return np.divide(depth_px, depth_m, out=np.zeros(depth_m.shape, np.float32), where=known)


def _told_px(message: Any) -> Disparity:  # noqa: ANN401
    """Return what a DisparityImage holds (H, W); 0 where it is invalid: not within its limits, or not a number."""
    found = pictures.floats(message.image)
    valid = (found >= np.float32(max(message.min_disparity, 0.0))) & (found <= np.float32(LARGEST_PX))
    return np.where(valid, found, np.float32(0))


def _baseline(
    camera: CameraMap, facts: Facts, projection: NDArray[np.float64], right_info: Info | None
) -> float | None:
    if camera.is_single or camera.baseline_m is not None:
        return camera.baseline_m
    if right_info is not None:
        return baseline_m(projection, right_info.projection(rectified=camera.rectified))
    assert camera.disparity is not None, "the map says how others are known"
    return facts.stereo[camera.disparity].baseline_m


def _calibration(
    camera: CameraMap, vehicle: VehicleMap, facts: Facts, projection: NDArray[np.float64], baseline: float | None
) -> CameraCalibration:
    """Put a calibration together; extrinsics of the map stand in it as they are."""
    if camera.extrinsics is None:
        frame = camera.frame or facts.frames[camera.image or camera.main_topic]
        found = CameraCalibration.of(projection, facts.transforms.lookup(vehicle.frame, frame), baseline)
    else:
        found = CameraCalibration.of(projection, CAMERA_FROM_OPTICAL, baseline)
        found = replace(found, **camera.extrinsics.model_dump())
    return replace(found, x_m=found.x_m + vehicle.rear_axle_m, z_m=found.z_m + vehicle.height_m)


def _require_size(facts: Facts, topic: str, info: Info, told_by: str | None) -> None:
    found, known = (ImageSize(each.width, each.height) for each in (facts.shapes[topic], info))
    if found != known:
        raise InputError(f"is {found}, but {told_by} calibrates {known}", field=topic)


def _require_agreement(facts: Facts, topic: str, calibration: CameraCalibration) -> None:
    stereo, baseline = facts.stereo[topic], calibration.baseline_m
    assert baseline is not None
    for name, told, known, share, unit in (
        ("f", stereo.f_px, calibration.fx_px, _FOCAL_SHARE, "px"),
        ("t", stereo.baseline_m, baseline, _BASELINE_SHARE, "m"),
    ):
        if abs(told - known) > share * known:
            raise InputError(f"{name} is {told:g} {unit}, but the calibration says {known:g} {unit}", field=topic)
