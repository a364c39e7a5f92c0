"""How far the actor that each cell of an input shows moves, truly, until the target's time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASSES, NO_POINT, Category
from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import add_points, no_points, rasterise
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.grids.truth import FrameLog, WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import Actor, CameraFrame
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.kinds import read_points
from semgrid_eval.sensors.projection import nearest_indices
from semgrid_eval.sensors.sensor import Points

Ids = NDArray[np.int64]
Metres = NDArray[np.float16]
_CAN_MOVE = np.array([entry.category in (Category.VEHICLES, Category.SMALL_DYNAMIC) for entry in CLASSES])


@dataclass(frozen=True)
class ActorMotion:
    """The motion of actors in the inputs of windows: (N, S, T, H, W, 2) metres forward and left, 0 where none is.

    A cell belongs to the actor that most of its points of its class show. Motion is over the ground, in the orientation
    of the grids, from the input's time to the target's; each input is centred on the vehicle at its own time.
    """

    sensors: tuple[str, ...]  # names along S

    def described(self, config: GridConfig) -> list[Any]:
        """Return all that decides the motion, as `Truth` says."""
        return [self.sensors, config.model_dump(mode="json")]

    def needed(self, times: WindowTimes) -> WindowTimes:
        """Keep all times."""
        return times

    def find(self, log: LogReader, config: GridConfig, times: WindowTimes) -> Metres:
        """Work out the motion in a log's windows, as `Truth` says: -> (N, S, T, H, W, 2)."""
        actors = _ActorGrids(log, config, self.sensors, times)
        truth = _TrueMotion(log, {*times.inputs_ns.ravel().tolist(), *times.target_ns.tolist()})
        windows, inputs = times.inputs_ns.shape
        shape = (windows, len(self.sensors), inputs, config.spec.rows, config.spec.columns, 2)
        found = np.zeros(shape, np.float16)
        for window, target_ns in enumerate(times.target_ns.tolist()):
            for i, stamp_ns in enumerate(times.inputs_ns[window].tolist()):
                yaw_rad = actors.yaw_rad(stamp_ns, int(times.first_ns[window]))
                for s, sensor in enumerate(self.sensors):
                    ids = actors.grid(sensor, stamp_ns, yaw_rad)
                    found[window, s, i] = truth.moved_m(ids, config.spec, yaw_rad, (stamp_ns, target_ns))
        return found


class _ActorGrids:
    """Whom the cells of some sensors' grids show."""

    def __init__(self, log: LogReader, config: GridConfig, sensors: Sequence[str], times: WindowTimes) -> None:
        self._config, self._motion = config, EgoMotion(log.motion(), config.integrator)
        wanted = set(times.inputs_ns.ravel().tolist())
        self._seen: dict[tuple[str, int], tuple[Points, Ids]] = {}
        for name in sensors:
            sensor = config.sensors[name]
            if not isinstance(sensor, CameraSensor):
                raise UnknownTruthError(f"whom sensor {name} sees is not known, as it is no camera", path=log.path)
            frames = [each for each in log.frames(log.choose_camera(sensor.camera)) if each.stamp_ns in wanted]
            instances = [_instances(log, sensor, frame) for frame in frames]
            with FrameLog(log.path, frames) as shown:
                seen = read_points(shown, {name: sensor}, config.class_by_label())
                for points, ids in zip(seen, instances, strict=True):
                    self._seen[name, points.stamp_ns] = points, ids

    def yaw_rad(self, stamp_ns: int, first_ns: int) -> float:
        """Return the vehicle's heading in the orientation of the grids of the recording that begins at `first_ns`."""
        there, first = self._motion.odom_from_vehicle(stamp_ns), self._motion.odom_from_vehicle(first_ns)
        return there.seen_from(first).yaw_rad

    def grid(self, sensor: str, stamp_ns: int, yaw_rad: float) -> Ids:
        """Name the actor of each cell (H, W), 0 where it shows none."""
        points, ids = self._seen[sensor, stamp_ns]
        spec, turn = self._config.spec, SE2(0.0, 0.0, yaw_rad)
        counts = no_points(spec)
        add_points(counts, points, turn, spec)
        classes = rasterise(counts, self._config.morphology)
        shown = np.flatnonzero((ids > 0) & (points.class_id != NO_POINT))
        place_m = turn.apply(np.stack([points.forward_m.flat[shown], points.left_m.flat[shown]], axis=-1))
        cells = _cells(place_m, spec)
        inside = ((cells >= 0) & (cells < (spec.rows, spec.columns))).all(axis=1)
        shown, cells = shown[inside], cells[inside]
        classes_there = classes[cells[:, 0], cells[:, 1]]
        agree = (points.class_id.flat[shown] == classes_there) & _CAN_MOVE[classes_there]
        flat = cells[agree] @ (spec.columns, 1)
        return _commonest(flat, ids.flat[shown[agree]], spec)


def _instances(log: LogReader, sensor: CameraSensor, frame: CameraFrame) -> Ids:
    """Return the actor of each pixel (H, W) of a sensor's part of the image, 0 where there is none."""
    if frame.instance_png is None:
        fault = "does not tell which pixels show whom: simulated logs do, recordings of sensors do not"
        raise UnknownTruthError(fault, path=log.path)
    picture = decode_gray(frame.instance_png, bit_depth=16)
    width, height = sensor.image_size_px
    rows, columns = nearest_indices(picture.shape[0], height), nearest_indices(picture.shape[1], width)
    top, bottom, left, right = sensor.crop_px
    return picture[rows[top:bottom]][:, columns[left:right]].astype(np.int64)


def _cells(place_m: NDArray[np.float64], spec: GridSpec) -> Ids:
    """Return row and column of places (N, 2) ahead and left of the vehicle, as `add_points` does."""
    corner = np.array([spec.agent_row, spec.agent_column], np.int64)
    return corner - 1 - np.floor(place_m / spec.cell_m).astype(np.int64)


def _commonest(cells: Ids, ids: Ids, spec: GridSpec) -> Ids:
    """Give each cell the id that most of its points have, of equally many the lowest: (N,), (N,) -> (H, W)."""
    grid = np.zeros(spec.rows * spec.columns, np.int64)
    pairs, counts = np.unique(np.stack([cells, ids], axis=-1), axis=0, return_counts=True)
    order = np.lexsort((-pairs[:, 1], counts))  # later ones overwrite earlier ones
    grid[pairs[order, 0]] = pairs[order, 1]
    return grid.reshape(spec.rows, spec.columns)


class _TrueMotion:
    """Where everybody truly is at some times."""

    def __init__(self, log: LogReader, stamps_ns: set[int]) -> None:
        self._log = log
        self._poses = {pose.stamp_ns: pose for pose in log.poses() if pose.stamp_ns in stamps_ns}
        self._actors = {stamp_ns: _by_id(actors) for stamp_ns, actors in log.actors() if stamp_ns in stamps_ns}

    def moved_m(self, ids: Ids, spec: GridSpec, yaw_rad: float, stamps_ns: tuple[int, int]) -> Metres:
        """Return how far each cell's actor moves between two times: actors (H, W) at the first -> (H, W, 2)."""
        found = np.zeros((*ids.shape, 2), np.float16)
        before, after = (self._at(stamp_ns) for stamp_ns in stamps_ns)
        pose = self._poses[stamps_ns[0]]
        forward_m, left_m = spec.centres_m()
        map_from_grid = SE2(pose.x_m, pose.y_m, pose.yaw_rad - yaw_rad)
        for actor in np.unique(ids[ids > 0]).tolist():
            if actor in before and actor in after:  # who leaves the town stays where he was last seen
                rows, columns = np.nonzero(ids == actor)
                start_m = map_from_grid.apply(np.stack([forward_m[rows], left_m[columns]], axis=-1))
                end_m = after[actor].apply(before[actor].inverse().apply(start_m))
                found[rows, columns] = SE2(0.0, 0.0, yaw_rad - pose.yaw_rad).apply(end_m - start_m)
        return found

    def _at(self, stamp_ns: int) -> dict[int, SE2]:
        if stamp_ns not in self._actors or stamp_ns not in self._poses:
            fault = f"does not tell where actors are at {stamp_ns} ns: simulated logs do, recordings of sensors do not"
            raise UnknownTruthError(fault, path=self._log.path)
        return self._actors[stamp_ns]


def _by_id(actors: Sequence[Actor]) -> dict[int, SE2]:
    return {each.actor_id: SE2(each.x_m, each.y_m, each.yaw_rad) for each in actors}
