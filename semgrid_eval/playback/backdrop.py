"""What surrounds grids: pictures, their calibration, and where the vehicle is."""

import heapq
from collections.abc import Iterator

from semgrid_eval.errors import LogError, located
from semgrid_eval.grids.shown import frame_poses, shown_lidar
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log import codec, topics
from semgrid_eval.log.calibrations import calibration_messages
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.playback.outgoing import Outgoing
from semgrid_eval.playback.pictures import picture_message
from semgrid_eval.recording.colour import read_size
from semgrid_eval.recording.panorama import panorama_png
from semgrid_eval.recording.types import Pose

_PICTURES = (topics.IMAGE, topics.LABEL)


class Backdrop:
    """What surrounds the grids of a log.

    Args:
        log: the open log.
        grid: how its grids were made; frames are the times of the sensor that leads the target, and `poses` the
            vehicle's at each of them, in the odom frame.

    Raises:
        LogError: the log is damaged, or has no such sensor, or later on no such frame.
    """

    def __init__(self, log: LogReader, grid: GridConfig) -> None:
        self.cameras = log.scene.cameras
        self._log = log
        self._calibrations = {name: log.calibration(name) for name in self.cameras}
        self._lidar = shown_lidar(log, grid)
        self.poses = frame_poses(log, grid)
        self._frames = {pose.stamp_ns: frame for frame, pose in enumerate(self.poses)}

    def frame_at(self, stamp_ns: int) -> int:
        """Return the index of the frame of a time."""
        if stamp_ns not in self._frames:
            raise LogError(f"has no frame at {stamp_ns} ns", path=self._log.path)
        return self._frames[stamp_ns]

    def messages(self, first_ns: int, last_ns: int, *, shift_ns: int, grid_yaw_rad: float) -> Iterator[Outgoing]:
        """Iterate over transforms, calibrations and pictures from `first_ns` to `last_ns`, all times shifted."""
        moving = self._transforms(first_ns, last_ns, shift_ns, grid_yaw_rad)
        seen = self._pictures(first_ns, last_ns, shift_ns), self._panoramas(first_ns, last_ns, shift_ns)
        return heapq.merge(moving, *seen, key=lambda sent: sent.log_ns)

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
                known, _ = calibration_messages(now_ns, camera, self._calibrations[camera], size_px)
                yield Outgoing(now_ns, camera_topic(camera, topics.CALIBRATION), known)
            yield Outgoing(now_ns, topic, codec.image_message(now_ns, camera, png), notes=notes[channel])

    def _panoramas(self, first_ns: int, last_ns: int, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over what a LiDAR saw all around, where it leads the target and the log has no camera."""
        if self._lidar is None:
            return
        topic = topics.lidar_picture_topic(self._lidar)
        for sweep in self._log.sweeps(self._lidar):
            if first_ns <= sweep.stamp_ns <= last_ns and sweep.label_id is not None:
                now_ns = sweep.stamp_ns + shift_ns
                yield Outgoing(now_ns, topic, picture_message(now_ns, panorama_png(sweep), topics.BASE_FRAME))

    def _size_px(self, png: bytes, topic: str) -> tuple[int, int]:
        with located(path=self._log.path, field=topic, kind=LogError):
            return read_size(png)
