"""The actors that inputs show, moved as they truly move until the target's time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import Cells, grid_of
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.grids.truth import FrameLog, WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.resizing import nearest_indices
from semgrid_eval.recording.types import Actor, CameraFrame
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.kinds import read_points
from semgrid_eval.sensors.sensor import Points

Ids = NDArray[np.int64]
Floats = NDArray[np.float64]
MOVES_FROM_M = 0.1
"""Who moves less until the target's time stays where an input shows him."""


class Mover(NamedTuple):
    """Points (N,) of actors that move in one input: indices into the sensor's, and where they are at both times."""

    points: Ids  # (N,) flat
    start_m: Floats  # (N, 2) forward and left of the vehicle at the input's time, in the grid's orientation
    end_m: Floats  # (N, 2) of the vehicle at the target's time
    moves: NDArray[np.bool_]  # (N,) whether it is `MOVES_FROM_M` or farther


@dataclass(frozen=True)
class MovedActors:
    """What moving actors leave and where they come to lie, for each input of windows: (N, S, T, 2, H, W) uint8.

    The first layer flags the cells of an input's own grid that belong to an actor that moves: most of the cell's points
    of its class show him. The second has the classes of all moving actors' points, each moved by its actor's true
    motion over the ground and made into a grid, in the target's place.
    """

    sensors: tuple[str, ...]  # names along S

    def described(self, config: GridConfig) -> list[Any]:
        """Return all that decides the layers, as `Truth` says."""
        return [self.sensors, config.identity()]

    def needed(self, times: WindowTimes) -> WindowTimes:
        """Keep all times."""
        return times

    def find(self, log: LogReader, config: GridConfig, times: WindowTimes) -> Cells:
        """Move the actors in a log's windows, as `Truth` says: -> (N, S, T, 2, H, W)."""
        spec, inputs = config.spec, times.inputs_ns.shape[1]
        truth = _TrueMotion(log, config, {*times.inputs_ns.ravel().tolist(), *times.target_ns.tolist()})
        found = np.zeros((len(times.target_ns), len(self.sensors), inputs, 2, spec.rows, spec.columns), np.uint8)
        for s, sensor in enumerate(self.sensors):
            seen = dict(_seen(log, config, sensor, set(times.inputs_ns.ravel().tolist())))
            for window, i in np.ndindex(times.inputs_ns.shape):
                stamps_ns = int(times.inputs_ns[window, i]), int(times.target_ns[window])
                first_ns = int(times.first_ns[window])
                if stamps_ns[0] not in seen:
                    fault = f"sensor {sensor} shows nothing at {stamps_ns[0]} ns, when the target's does"
                    raise UnknownTruthError(fault, path=log.path)
                points, ids = seen[stamps_ns[0]]
                movers = truth.movers(points, ids, stamps_ns, first_ns)
                found[window, s, i, 0] = _left(points, ids, movers, truth.yaw_rad(stamps_ns[0], first_ns), config)
                found[window, s, i, 1] = _arrived(points, movers, config)
        return found


def _seen(
    log: LogReader, config: GridConfig, name: str, stamps_ns: set[int]
) -> Iterator[tuple[int, tuple[Points, Ids]]]:
    """Go through what a sensor saw at some times, and the actor of each point, 0 where it is none."""
    sensor = config.sensors[name]
    if not isinstance(sensor, CameraSensor):
        raise UnknownTruthError(f"whom sensor {name} sees is not known, as it is no camera", path=log.path)
    frames = [each for each in log.frames(log.choose_camera(sensor.camera)) if each.stamp_ns in stamps_ns]
    instances = [_instances(log, sensor, frame) for frame in frames]
    movable = np.array(config.classes.movable, np.uint8)
    with FrameLog(log.path, frames) as shown:
        for points, ids in zip(read_points(shown, {name: sensor}, config.class_by_label()), instances, strict=True):
            yield points.stamp_ns, (points, np.where(np.isin(points.class_id, movable), ids, 0))


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


class _TrueMotion:
    """Where everybody truly is at some times, and where the vehicle takes itself to be."""

    def __init__(self, log: LogReader, config: GridConfig, stamps_ns: set[int]) -> None:
        self._log, self._motion = log, EgoMotion(log.motion(), config.integrator)
        self._poses = {pose.stamp_ns: pose for pose in log.poses() if pose.stamp_ns in stamps_ns}
        self._actors = {stamp_ns: _by_id(actors) for stamp_ns, actors in log.actors() if stamp_ns in stamps_ns}

    def yaw_rad(self, stamp_ns: int, first_ns: int) -> float:
        """Return the vehicle's heading in the orientation of the grids of the recording that begins at `first_ns`."""
        return self._place(stamp_ns, first_ns).yaw_rad

    def movers(self, points: Points, ids: Ids, stamps_ns: tuple[int, int], first_ns: int) -> Mover:
        """Move the points of actors from an input's time to the target's; who leaves the town stays where he was."""
        before, after = (self._everybody(stamp_ns) for stamp_ns in stamps_ns)
        here, there = (self._place(stamp_ns, first_ns) for stamp_ns in stamps_ns)
        shown = np.flatnonzero(ids)
        start_m = SE2(0.0, 0.0, here.yaw_rad).apply(
            np.stack([points.forward_m.flat[shown], points.left_m.flat[shown]], -1)
        )
        pose, actor = self._poses[stamps_ns[0]], ids.flat[shown]
        map_m = SE2(pose.x_m, pose.y_m, pose.yaw_rad - here.yaw_rad).apply(start_m)
        moved_m = map_m.copy()
        for known in (before.keys() & after.keys()).intersection(np.unique(actor).tolist()):
            mine = actor == known
            moved_m[mine] = after[known].apply(before[known].inverse().apply(map_m[mine]))
        way_m = SE2(0.0, 0.0, here.yaw_rad - pose.yaw_rad).apply(moved_m - map_m)
        end_m = start_m + way_m - (there.x_m - here.x_m, there.y_m - here.y_m)
        return Mover(shown, start_m, end_m, np.hypot(*way_m.T) >= MOVES_FROM_M)

    def _place(self, stamp_ns: int, first_ns: int) -> SE2:
        return self._motion.odom_from_vehicle(stamp_ns).seen_from(self._motion.odom_from_vehicle(first_ns))

    def _everybody(self, stamp_ns: int) -> dict[int, SE2]:
        if stamp_ns not in self._actors or stamp_ns not in self._poses:
            fault = f"does not tell where actors are at {stamp_ns} ns: simulated logs do, recordings of sensors do not"
            raise UnknownTruthError(fault, path=self._log.path)
        return self._actors[stamp_ns]


def _by_id(actors: Sequence[Actor]) -> dict[int, SE2]:
    return {each.actor_id: SE2(each.x_m, each.y_m, each.yaw_rad) for each in actors}


def _arrived(points: Points, movers: Mover, config: GridConfig) -> Cells:
    """Make a grid (H, W) of the points of those who move, where they come to lie."""
    there_m = movers.end_m[movers.moves]
    classes = points.class_id.flat[movers.points[movers.moves]]
    moved = replace(points, forward_m=there_m[:, 0], left_m=there_m[:, 1], class_id=classes)
    return grid_of([(moved, SE2(0.0, 0.0, 0.0))], config)


def _left(points: Points, ids: Ids, movers: Mover, yaw_rad: float, config: GridConfig) -> Cells:
    """Flag the cells (H, W) of an input's own grid that belong to somebody who moves."""
    spec = config.spec
    grid = grid_of([(points, SE2(0.0, 0.0, yaw_rad))], config)
    cells = _cells(movers.start_m, spec)
    inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
    cells, shown, moves = cells[inside], movers.points[inside], movers.moves[inside]
    agrees = points.class_id.flat[shown] == grid[tuple(cells.T)]
    whose = _commonest(cells[agrees], np.where(moves[agrees], ids.flat[shown[agrees]], 0), spec)
    return (whose > 0).astype(np.uint8)


def _cells(place_m: Floats, spec: GridSpec) -> Ids:
    """Return row and column of places (N, 2) ahead and left of the vehicle, as `add_points` does."""
    corner = np.array([spec.agent_row, spec.agent_column], np.int64)
    return corner - 1 - np.floor(place_m / spec.cell_m).astype(np.int64)


def _commonest(cells: Ids, ids: Ids, spec: GridSpec) -> Ids:
    """Give each cell (N, 2) the id that most of its points (N,) have, of equally many the lowest: -> (H, W)."""
    grid = np.zeros((spec.rows, spec.columns), np.int64)
    found, counts = np.unique(np.column_stack([cells, ids]), axis=0, return_counts=True)
    order = np.lexsort((-found[:, 2], counts))  # later ones overwrite earlier ones
    rows, columns, named = found[order].T
    grid[rows, columns] = named
    return grid
