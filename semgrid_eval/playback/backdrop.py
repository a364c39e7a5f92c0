"""What a viewer wants beside grids: pictures, their calibration, where the vehicle is, and the layout of panels."""

import heapq
import json
import re
from collections.abc import Iterator, Sequence
from importlib import resources
from typing import Any, NamedTuple

from google.protobuf.message import Message

from semgrid_eval.errors import InputError, LogError, printable
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log import codec, topics
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import GRID_INPUT, GRID_PREDICTION, camera_topic
from semgrid_eval.recording.colour import read_size
from semgrid_eval.recording.types import Pose
from semgrid_eval.scores.results import RowRecord
from semgrid_eval.sensors.camera import frame_poses

_PICTURES = (topics.IMAGE, topics.LABEL)


class Outgoing(NamedTuple):
    """A message to write, with the arguments of `MessageWriter.write`."""

    log_ns: int
    topic: str
    message: Message
    publish_ns: int | None = None
    notes: dict[str, str] | None = None


class Backdrop:
    """What surrounds the grids of a log.

    Args:
        log: the open log.
        grid: how its grids were made; frames are those of the camera that leads the target, and `poses` the vehicle's
            at each of them, in the odom frame.

    Raises:
        InputError: no camera leads the target.
        LogError: the log is damaged, or has no such camera, or later on no such frame.
    """

    def __init__(self, log: LogReader, grid: GridConfig) -> None:
        if grid.camera is None:
            raise InputError(f"frames of {grid.target[0]!r}, which is not a camera, cannot be found", path=log.path)
        self.cameras = log.scene.cameras
        self._log = log
        self._calibrations = {name: log.calibration(name) for name in self.cameras}
        self.poses = frame_poses(log, grid.camera, grid.integrator)
        self._frames = {pose.stamp_ns: frame for frame, pose in enumerate(self.poses)}

    def frame_at(self, stamp_ns: int) -> int:
        """Return the index of the frame of a time."""
        if stamp_ns not in self._frames:
            raise LogError(f"has no frame at {stamp_ns} ns", path=self._log.path)
        return self._frames[stamp_ns]

    def messages(self, first_ns: int, last_ns: int, *, shift_ns: int, grid_yaw_rad: float) -> Iterator[Outgoing]:
        """Iterate over transforms, calibrations and pictures from `first_ns` to `last_ns`, all times shifted."""
        moving = self._transforms(first_ns, last_ns, shift_ns, grid_yaw_rad)
        return heapq.merge(moving, self._pictures(first_ns, last_ns, shift_ns), key=lambda sent: sent.log_ns)

    def _transforms(self, first_ns: int, last_ns: int, shift_ns: int, grid_yaw_rad: float) -> Iterator[Outgoing]:
        for pose in self.poses:
            if first_ns <= pose.stamp_ns <= last_ns:
                now = Pose(pose.stamp_ns + shift_ns, pose.x_m, pose.y_m, pose.yaw_rad)
                message = codec.transforms_message(now, self._calibrations, grid_yaw_rad=grid_yaw_rad)
                yield Outgoing(now.stamp_ns, topics.TRANSFORMS, message)

    def _pictures(self, first_ns: int, last_ns: int, shift_ns: int) -> Iterator[Outgoing]:
        notes = dict(topics.PICTURES.values())
        calibrated: dict[str, int] = {}
        for stamp_ns, camera, channel, png in self._log.pictures(self.cameras, _PICTURES):
            if stamp_ns < first_ns:
                continue
            if stamp_ns > last_ns:
                return
            topic, now_ns = camera_topic(camera, channel), stamp_ns + shift_ns
            if calibrated.get(camera) != now_ns:
                calibrated[camera] = now_ns
                size_px = self._size_px(png, topic)
                known, _ = codec.calibration_messages(now_ns, camera, self._calibrations[camera], size_px)
                yield Outgoing(now_ns, camera_topic(camera, topics.CALIBRATION), known)
            yield Outgoing(now_ns, topic, codec.image_message(now_ns, camera, png), notes=notes[channel])

    def _size_px(self, png: bytes, topic: str) -> tuple[int, int]:
        try:
            return read_size(png)
        except InputError as error:
            raise LogError(str(error), path=self._log.path, field=topic) from error


_TEMPLATE = "data/foxglove_layout.json"


def viewer_layout(row: RowRecord, cameras: Sequence[str]) -> dict[str, Any]:
    """Fill the template for a row and the first of the cameras; without a camera, the panels of pictures go."""
    text = resources.files("semgrid_eval").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    text = text.replace("{prediction}", prediction_topic(row.name))
    text = text.replace("{camera}", cameras[0] if cameras else "").replace(
        "{row}", json.dumps(printable(row.name))[1:-1]
    )
    layout: dict[str, Any] = json.loads(text)
    shown = layout["configById"]["3D!input"]["topics"]
    settings = shown.pop(f"{GRID_INPUT}/{{sensor}}")
    shown.update({f"{GRID_INPUT}/{sensor}": settings for sensor in row.facts.sensors})
    if row.facts.stream is not None:  # its inputs are not kept
        del layout["configById"]["3D!input"]
        layout["layout"]["second"]["first"] = "3D!certainty"
    if not cameras:
        panels = layout["configById"]
        layout["configById"] = {name: panels[name] for name in panels if not name.startswith("Image!")}
        layout["layout"] = layout["layout"]["second"]
    return layout


def prediction_topic(row_name: str) -> str:
    """Return the topic of a row's predictions; characters that mean something to viewers become underscores."""
    return f"{GRID_PREDICTION}/{re.sub(r'[^A-Za-z0-9_.-]', '_', row_name)}"
