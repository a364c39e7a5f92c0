"""Cameras with disparity and labels: a rectangle of the image is a sensor."""

import heapq
import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from semgrid_eval.errors import AbsentSensorError, LogError, located
from semgrid_eval.log.topics import DISPARITY, LABEL, camera_topic
from semgrid_eval.sensors.sensor import Points, SensorConfig

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader

_SIZE_PX = (16, 8192)


class CameraSensor(SensorConfig):
    """A rectangle of a camera's image, in pixels of the resized image, ends exclusive."""

    kind: Literal["camera"] = "camera"
    camera: str | None = None  # its name in the log; None takes a log's only one
    image_size_px: tuple[int, int] = (512, 256)  # to which labels and disparity are brought first (reading 22)
    top_px: int = Field(0, ge=0)
    bottom_px: int | None = None  # None reaches to the edge
    left_px: int = Field(0, ge=0)
    right_px: int | None = None  # None reaches to the edge
    # Pixels that give no point (`sensors.exclusion`): those with another class at most so many pixels away, and those
    # with a neighbour whose disparity differs by more; both in pixels of the resized image. What is not set is not
    # written either, so that grids of all pixels keep their digests.
    exclude_border_px: int = Field(0, ge=0, le=64, exclude_if=operator.not_)
    exclude_depth_step_px: float | None = Field(None, gt=0.0, le=100.0, exclude_if=operator.not_)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        width, height = self.image_size_px
        least, most = _SIZE_PX
        if not (least <= width <= most and least <= height <= most):
            raise ValueError(f"image_size_px {width} x {height} is outside {least} to {most}")
        top, bottom, left, right = self.crop_px
        if bottom <= top or right <= left:
            raise ValueError(f"rows {top} to {bottom} and columns {left} to {right} cover no pixel")
        if bottom > height or right > width:
            place = f"rows {top} to {bottom} and columns {left} to {right} reach"
            raise ValueError(f"{place} beyond the image of {width} x {height} px")
        return self

    @property
    def crop_px(self) -> tuple[int, int, int, int]:
        """Top, bottom, left and right of the rectangle."""
        width, height = self.image_size_px
        bottom = height if self.bottom_px is None else self.bottom_px
        right = width if self.right_px is None else self.right_px
        return self.top_px, bottom, self.left_px, right

    @property
    def is_whole_image(self) -> bool:
        """Whether the rectangle is the whole image."""
        width, height = self.image_size_px
        return self.crop_px == (0, height, 0, width)

    def shares_image_with(self, other: "CameraSensor") -> bool:
        """Tell whether both are parts of one camera's image; who names no camera means a log's only one."""
        return self.camera == other.camera or None in (self.camera, other.camera)


def read_cameras(
    log: "LogReader", sensors: Mapping[str, CameraSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what parts of cameras' images see, each image decoded once, as `Kind` says."""
    by_camera: dict[str, dict[str, CameraSensor]] = {}
    for name, sensor in sensors.items():
        by_camera.setdefault(stereo_camera(log, sensor.camera), {})[name] = sensor
    streams = [_read_camera(log, camera, parts, class_by_label) for camera, parts in by_camera.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)


def camera_frames(log: "LogReader", sensor: CameraSensor) -> str:
    """Return the topic of what every frame of a sensor's camera has.

    Raises:
        AbsentSensorError: as `stereo_camera` says.
    """
    return camera_topic(stereo_camera(log, sensor.camera), DISPARITY)


def stereo_camera(log: "LogReader", wanted: str | None) -> str:
    """Return the camera that is wanted, or the log's only one with disparity where none is.

    Raises:
        AbsentSensorError: there is no such camera, it has no disparity, or none is wanted and not just one has it.
    """
    cameras = log.scene.cameras if wanted is None else (log.choose_camera(wanted),)
    stereo = [camera for camera in cameras if not log.is_single(camera)]
    if cameras and not stereo:
        raise AbsentSensorError(_without_disparity(cameras), path=log.path, field=f"camera {', '.join(cameras)}")
    return stereo[0] if len(stereo) == 1 else log.choose_camera(wanted)


def _without_disparity(cameras: Sequence[str]) -> str:
    fault = "has no disparity, so nothing tells where in a grid its pixels belong; it"
    names = cameras[0]
    if len(cameras) > 1:
        fault = "have no disparity, so nothing tells where in a grid their pixels belong; they"
        names = f"[{', '.join(cameras)}]"
    return f"{fault} can colour a LiDAR's points: {{kind: lidar, colour_from: {{camera: {names}}}}}"


def _read_camera(
    log: "LogReader", camera: str, sensors: Mapping[str, CameraSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    # Whoever reads settings alone does not wait for a compiler.
    from semgrid_eval.recording.png import decode_gray
    from semgrid_eval.sensors.exclusion import Exclusion
    from semgrid_eval.sensors.projection import Projection

    calibration = log.calibration(camera)
    views = {
        name: (sensor.image_size_px, Exclusion(sensor.exclude_border_px, sensor.exclude_depth_step_px))
        for name, sensor in sensors.items()
    }
    projections = {
        (size_px, exclusion): Projection(calibration, size_px, class_by_label, exclusion)
        for size_px, exclusion in views.values()
    }
    for frame in log.frames(camera):
        if not frame.label_png:
            place = f"frame at {frame.stamp_ns} ns"
            raise LogError("has no label image; `semgrid-eval segment` adds them", field=place)
        assert frame.disparity_png is not None, "all frames of a camera with a baseline have disparity"
        with located(field=f"{camera_topic(camera, DISPARITY)} at {frame.stamp_ns} ns", kind=LogError):
            disparity = decode_gray(frame.disparity_png, bit_depth=16)
        with located(field=f"{camera_topic(camera, LABEL)} at {frame.stamp_ns} ns", kind=LogError):
            label = decode_gray(frame.label_png, bit_depth=8)
        seen = {view: projection.points(disparity, label) for view, projection in projections.items()}
        for name, sensor in sensors.items():
            top, bottom, left, right = sensor.crop_px
            pixels, part = seen[views[name]], np.s_[top:bottom, left:right]
            yield Points(name, frame.stamp_ns, pixels.forward_m[part], pixels.left_m[part], pixels.class_id[part])
