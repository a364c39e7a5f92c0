"""How often each class would be measured in each cell of a target, if only the errors were drawn again."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import grid_of
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import FrameLog, WindowTimes, plain_png
from semgrid_eval.log.reader import LogReader
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.kinds import read_points
from semgrid_eval.sensors.sensor import Points
from semgrid_eval.sources.redrawing import Pictures, redrawing_of

Votes = NDArray[np.uint8]
MOST_DRAWS = 255
"""Votes are counted in bytes."""


@dataclass(frozen=True)
class Draws:
    """The targets of windows as grids of draws: (N, C, H, W) votes for each class.

    Errors are drawn onto the exact pictures of the target's time; what is measured goes the way of every measurement.
    """

    count: int  # of draws, at most `MOST_DRAWS`
    # Whether they go on from the recording's own errors, as they are at the newest input, or are new.
    continued: bool

    def described(self, config: GridConfig) -> list[Any]:
        """Return all that decides the votes, as `Truth` says."""
        return [self.count, self.continued, config.target_identity()]

    def needed(self, times: WindowTimes) -> WindowTimes:
        """Keep the newest input, and of new errors none."""
        return replace(times, inputs_ns=times.inputs_ns[:, -1:] if self.continued else times.inputs_ns[:, :0])

    def find(self, log: LogReader, config: GridConfig, times: WindowTimes) -> Votes:
        """Draw the targets of a log's windows, as `Truth` says: -> (N, C, H, W)."""
        camera = _camera_of(log, config)
        redrawing = redrawing_of(log, camera)
        exact = _ExactPictures(log, camera)
        motion = EgoMotion(log.motion(), config.integrator)
        found = np.zeros((len(times.target_ns), *config.layers_shape), np.uint8)
        newest_ns = times.inputs_ns[:, -1] if self.continued else times.target_ns
        for window in np.argsort(newest_ns, kind="stable"):  # the errors go on from one newest input to the next
            target_ns = int(times.target_ns[window])
            pictures, target = exact.at(target_ns)
            if self.continued:
                newest = exact.number(int(newest_ns[window]))
                drawn = redrawing.continued(pictures, newest, target, self.count)
            else:
                drawn = redrawing.fresh(pictures, target, self.count)
            place = motion.odom_from_vehicle(target_ns).seen_from(motion.odom_from_vehicle(int(times.first_ns[window])))
            found[window] = _votes(log, config, drawn, SE2(0.0, 0.0, place.yaw_rad), target_ns)
        return found


class _ExactPictures:
    """The exact pictures of a camera by time, and the numbers of its frames."""

    def __init__(self, log: LogReader, camera: str) -> None:
        self._log = log
        self._frames = {frame.stamp_ns: (frame, number) for number, frame in enumerate(log.frames(camera))}

    def number(self, stamp_ns: int) -> int:
        """Number the frame of a time."""
        return self._frame(stamp_ns)[1]

    def at(self, stamp_ns: int) -> tuple[Pictures, int]:
        """Return the exact pictures of a time and the number of its frame."""
        frame, number = self._frame(stamp_ns)
        if frame.exact_label_png is None or frame.exact_disparity_png is None:
            raise UnknownTruthError("has no exact pictures", path=self._log.path, field=f"frame at {stamp_ns} ns")
        label = decode_gray(frame.exact_label_png, bit_depth=8).astype(np.uint8, copy=False)
        disparity = decode_gray(frame.exact_disparity_png, bit_depth=16).astype(np.uint16, copy=False)
        return Pictures(label, disparity), number

    def _frame(self, stamp_ns: int) -> tuple[CameraFrame, int]:
        if stamp_ns not in self._frames:
            raise UnknownTruthError(f"the target's camera has no frame at {stamp_ns} ns", path=self._log.path)
        return self._frames[stamp_ns]


def _camera_of(log: LogReader, config: GridConfig) -> str:
    """Return the one camera whose parts make the targets."""
    sensors = [config.sensors[name] for name in config.target]
    cameras = {log.choose_camera(each.camera) if isinstance(each, CameraSensor) else "" for each in sensors}
    if len(cameras) > 1 or "" in cameras:
        fault = f"only targets of one camera can be drawn again, and these are of {', '.join(config.target)}"
        raise UnknownTruthError(fault, path=log.path)
    return cameras.pop()


def _votes(log: LogReader, config: GridConfig, drawn: Iterable[Pictures], place: SE2, stamp_ns: int) -> Votes:
    """Make a grid of each draw, as measurements are made into grids, and count its classes: -> (C, H, W)."""
    # Times tell the draws apart, a nanosecond each.
    frames = [
        CameraFrame(stamp_ns + draw, None, plain_png(each.disparity), plain_png(each.label))
        for draw, each in enumerate(drawn)
    ]
    by_draw = defaultdict[int, list[Points]](list)
    votes = np.zeros(config.layers_shape, np.uint8)
    with FrameLog(log.path, frames) as shown:
        for points in read_points(
            shown, {name: config.sensors[name] for name in config.target}, config.class_by_label()
        ):
            by_draw[points.stamp_ns].append(points)
            if len(by_draw[points.stamp_ns]) == len(config.target):
                grid = grid_of(((seen, place) for seen in by_draw.pop(points.stamp_ns)), config)
                votes += grid == np.arange(config.classes.count, dtype=np.uint8)[:, None, None]
    return votes
