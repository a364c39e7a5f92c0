"""Where the true actors stand in a grid: footprints of standing and of moving ones, for scores around them alone."""

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import LogError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.spec import MOVING, STANDING, GridSpec
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import TRUE_ACTORS
from semgrid_eval.recording.types import Actor, Pose

MOVING_FROM_MPS = 0.5
# Footprints grow by this much on each side, since the noise of depth smears what a sensor sees of an actor. It is one
# cell of the paper's grid, and as many metres on every other one.
MARGIN_M = 100.0 / 128.0

Flags = NDArray[np.uint8]
Floats = NDArray[np.float64]


class TrueActors:
    """The true actors of one log, read once from its beginning to its end."""

    def __init__(self, reader: LogReader, spec: GridSpec) -> None:
        self._path, self._spec = reader.path, spec
        self._poses = {pose.stamp_ns: pose for pose in reader.poses()}
        self._moments = reader.actors()
        self._moment = next(self._moments, None)

    def flags(self, stamps_ns: NDArray[np.int64], yaw_rad: Floats) -> Flags | None:
        """Draw the footprints at (F,) times, later ones than at the last call: -> (F, H, W).

        None where the truth is not known at each of them. `yaw_rad` (F,) is the heading of the vehicle in the
        orientation of the grid.

        Raises:
            LogError: the truth is damaged or not finite.
        """
        drawn = []
        for stamp_ns, yaw in zip(stamps_ns.tolist(), yaw_rad.tolist(), strict=True):
            actors, pose = self._actors_at(stamp_ns), self._poses.get(stamp_ns)
            if actors is None or pose is None:
                return None
            boxes = boxes_in_grid(actors, pose, yaw)
            if not np.isfinite(boxes).all():
                raise LogError(f"is not finite at {stamp_ns} ns", path=self._path, field=TRUE_ACTORS)
            drawn.append(draw_boxes(boxes, self._spec))
        return np.stack(drawn)

    def _actors_at(self, stamp_ns: int) -> tuple[Actor, ...] | None:
        while self._moment is not None and self._moment[0] < stamp_ns:
            self._moment = next(self._moments, None)
        return self._moment[1] if self._moment is not None and self._moment[0] == stamp_ns else None


def boxes_in_grid(actors: Sequence[Actor], pose: Pose, yaw_rad: float) -> Floats:
    """Bring actors into a grid's orientation: -> (A, 6) forward and left of the vehicle, yaw, length, width, speed.

    Actors and `pose` are in the map frame; `yaw_rad` is the heading of the vehicle in the orientation of the grid. The
    vehicle itself, should it be among the actors, is left out: only its own footprint covers its origin.
    """
    if not actors:
        return np.zeros((0, 6))
    rows = [
        (a.x_m, a.y_m, a.yaw_rad, a.length_m, a.width_m, np.hypot(a.velocity_x_mps, a.velocity_y_mps)) for a in actors
    ]
    boxes = np.array(rows, np.float64)
    turn_rad = yaw_rad - pose.yaw_rad
    boxes[:, :2] = SE2(0.0, 0.0, turn_rad).apply(boxes[:, :2] - (pose.x_m, pose.y_m))
    boxes[:, 2] += turn_rad
    along_m = np.cos(boxes[:, 2]) * boxes[:, 0] + np.sin(boxes[:, 2]) * boxes[:, 1]
    across_m = np.cos(boxes[:, 2]) * boxes[:, 1] - np.sin(boxes[:, 2]) * boxes[:, 0]
    covers_origin = (np.abs(along_m) <= boxes[:, 3] / 2) & (np.abs(across_m) <= boxes[:, 4] / 2)
    return boxes[~covers_origin]


def draw_boxes(boxes: Floats, spec: GridSpec) -> Flags:
    """Flag the cells whose middle lies in a box grown by the margin: (A, 6) of `boxes_in_grid` -> (H, W)."""
    flags = np.zeros((spec.rows, spec.columns), np.uint8)
    bits = np.where(boxes[:, 5] >= MOVING_FROM_MPS, MOVING, STANDING).astype(np.uint8)
    # In cells from the corner that is the vehicle's origin, along the axes of rows and columns.
    cells = boxes[:, :5] / np.array([spec.cell_m, spec.cell_m, 1.0, 2 * spec.cell_m, 2 * spec.cell_m])
    cells[:, 3:] += MARGIN_M / spec.cell_m
    _draw(cells, bits, spec.agent_row, spec.agent_column, flags)
    return flags


@numba.njit(cache=True, nogil=True)
def _draw(cells, bits, agent_row, agent_column, flags):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    rows, columns = flags.shape
    for box in range(len(cells)):
        forward, left, yaw_rad, half_length, half_width = cells[box]
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        reach_forward = abs(cosine) * half_length + abs(sine) * half_width
        reach_left = abs(sine) * half_length + abs(cosine) * half_width
        middle_row, middle_column = agent_row - 0.5 - forward, agent_column - 0.5 - left
        first_row = int(min(max(np.floor(middle_row - reach_forward), 0.0), rows))
        end_row = int(max(min(np.ceil(middle_row + reach_forward) + 1.0, rows), 0.0))
        first_column = int(min(max(np.floor(middle_column - reach_left), 0.0), columns))
        end_column = int(max(min(np.ceil(middle_column + reach_left) + 1.0, columns), 0.0))
        for row in range(first_row, end_row):
            for column in range(first_column, end_column):
                ahead, aside = middle_row - row, middle_column - column
                along = cosine * ahead + sine * aside
                across = cosine * aside - sine * ahead
                if abs(along) <= half_length and abs(across) <= half_width:
                    flags[row, column] |= bits[box]
