"""The grids of all recordings in one block, moved by the ego motion (T2), and the mask M."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.classes import DEFAULT_CLASSES, UNKNOWN, ClassSet
from semgrid_eval.errors import InputError
from semgrid_eval.windows.actors import ActorFlags
from semgrid_eval.windows.storage import Block, GatheredBlock, HeldBlock, Storage

if TYPE_CHECKING:  # building grids needs the log readers; using built ones does not
    from semgrid_eval.grids.recording import RecordingGrids

# How long an actor's footprints stay near a target. That holds all ghosts that rows of the paper can leave: five
# inputs, or a horizon three steps longer, reach back 25 frames, 1.47 s.
GHOST_S = 1.5


@dataclass(frozen=True)
class GridData:
    """The grids of all recordings on one device, recordings one after the other along F."""

    block: Block  # (S, F, H, W) class ids, gathered when they are first asked for
    sensors: tuple[str, ...]  # names along S
    target: str  # which of them the targets come from
    recordings: tuple[str, ...]  # names of the recordings
    logs: tuple[str, ...]  # paths of their logs
    digests: tuple[str, ...]  # of those logs
    groups: tuple[str, ...]  # town, city or drive of each recording, empty where its log does not say
    first_frames: NDArray[np.int64]  # (R + 1,) where each recording begins along F, and F
    stamps_ns: NDArray[np.int64]  # (F,) int64
    position_m: NDArray[np.float64]  # (F, 2) forward and left in the grid orientation of the frame's own recording
    yaw_rad: NDArray[np.float64]  # (F,) heading in that orientation
    cell_m: float  # edge of a cell
    actors: ActorFlags  # of true actors, on the host: scores are split by them, and nothing is predicted from them
    classes: ClassSet = DEFAULT_CLASSES  # of the grids' cells

    @property
    def grids(self) -> Tensor:
        """Return the class ids (S, F, H, W) uint8."""
        return self.block.tensor

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of a grid."""
        return self.block.shape[2:]

    @property
    def device(self) -> torch.device:
        """Where the class ids lie."""
        return self.block.device

    def to(self, device: torch.device) -> "GridData":
        """Return the same data with its grids on a device, gathered if they were not yet."""
        grids = self.grids
        return self if device == self.device else replace(self, block=HeldBlock(grids.to(device)))

    @property
    def frame_counts(self) -> list[int]:
        """Frames of each recording."""
        return [int(count) for count in np.diff(self.first_frames)]

    def locate(self, frames: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find frames, indices along F: (N,) -> the recording of each (N,) and the index of the frame there (N,)."""
        owners = np.searchsorted(self.first_frames, frames, side="right") - 1
        return owners, frames - self.first_frames[owners]

    def actors_near(self, target_frames: NDArray[np.int64]) -> NDArray[np.uint8] | None:
        """Flag where true actors are, or were during the last `GHOST_S`: -> (N, H, W), in the targets' places.

        There a model without any idea of motion may leave a ghost, whichever inputs it has: the flags are those of a
        target, whatever a row sees. Footprints of all frames of that time are moved by the ego motion, like grids, and
        are grown by `MARGIN_M`. Targets of recordings without the truth have no flags; None where no recording has it.

        Args:
            target_frames: (N,) indices along F.
        """
        if not any(self.actors.known):
            return None
        found = np.zeros((len(target_frames), *self.size), np.uint8)
        for result, target, owner in zip(found, target_frames, self.locate(target_frames)[0], strict=True):
            if self.actors.known[owner]:
                near = self.actors.near(int(target), partial(self._actors_near, int(target), int(owner)))
                result[:] = near.reshape(self.size)
        return found

    def _actors_near(self, target: int, owner: int) -> NDArray[np.uint8]:
        begin = self.first_frames[owner]
        age_s = (self.stamps_ns[target] - self.stamps_ns[begin : target + 1]) * 1e-9
        first = begin + int(np.argmax(age_s <= GHOST_S))
        moved_m = self.position_m[target] - self.position_m[first : target + 1]
        shift_cells = torch.from_numpy(shift_in_cells(moved_m, self.cell_m))
        seen = torch.from_numpy(self.actors.of(owner)[first - begin : target + 1 - begin])
        near: NDArray[np.uint8] = np.bitwise_or.reduce(shift_grids(seen, shift_cells).numpy(), axis=0)
        return near

    def sensor_index(self, name: str) -> int:
        """Find a sensor.

        Raises:
            InputError: the grids have no such sensor.
        """
        if name not in self.sensors:
            raise InputError(f"the grids have no sensor {name!r}, only {', '.join(self.sensors)}", field="sensors")
        return self.sensors.index(name)


def stack_recordings(
    recordings: Sequence["RecordingGrids"],
    *,
    cell_m: float,
    classes: ClassSet = DEFAULT_CLASSES,
    sensors: Sequence[str] | None = None,
    storage: Storage | None = None,
) -> GridData:
    """Put recordings into one block; `sensors` limits it to those and the target's (default: all).

    Edge of a cell and classes are those of the configuration by which the grids were made. The block is in memory
    unless a `storage` is given.

    Raises:
        InputError: there is no recording, or one lacks a sensor or has grids of another size.
    """
    if not recordings:
        raise InputError("there are no grids to take windows from")
    target = recordings[0].target
    kept = tuple(dict.fromkeys([*(sensors or recordings[0].sensors), target]))
    for entry in recordings:
        _check_recording(entry, kept, recordings[0].size)
    return GridData(
        block=GatheredBlock(recordings, kept, storage or Storage(torch.device("cpu"))),
        sensors=kept,
        target=target,
        recordings=tuple(entry.name for entry in recordings),
        logs=tuple(entry.log for entry in recordings),
        digests=tuple(entry.digest for entry in recordings),
        groups=tuple(entry.group for entry in recordings),
        first_frames=np.cumsum([0, *(len(entry.stamps_ns) for entry in recordings)], dtype=np.int64),
        stamps_ns=np.concatenate([entry.stamps_ns for entry in recordings]),
        position_m=np.concatenate([entry.position_m for entry in recordings]),
        yaw_rad=np.concatenate([entry.yaw_rad for entry in recordings]),
        cell_m=cell_m,
        actors=ActorFlags(recordings),
        classes=classes,
    )


def _check_recording(entry: "RecordingGrids", sensors: tuple[str, ...], size: tuple[int, int]) -> None:
    for name in sensors:
        if name not in entry.sensors:
            raise InputError(f"the grids of {entry.name} have no sensor {name!r}, only {', '.join(entry.sensors)}")
    if entry.size != size:
        raise InputError(f"the grids of {entry.name} are {entry.size}, and the first ones are {size}")


def shift_in_cells(moved_m: NDArray[np.float64], cell_m: float) -> NDArray[np.int64]:
    """Round the way of the ego vehicle (..., 2: forward, left) to the cells (rows, columns) that content moves by.

    Driving forward brings content nearer (down the rows); driving left moves it right (up the columns).
    """
    return np.rint(moved_m / cell_m).astype(np.int64)


def shift_grids(grids: Tensor, shift_cells: Tensor) -> Tensor:
    """Move content by whole cells (T2): (..., H, W) by (..., 2) rows and columns -> (..., H, W).

    What leaves the grid is lost, and cells that enter it are unknown.
    """
    rows, columns = grids.shape[-2:]
    source_row = torch.arange(rows, device=grids.device) - shift_cells[..., 0:1]  # (..., H)
    source_column = torch.arange(columns, device=grids.device) - shift_cells[..., 1:2]  # (..., W)
    return take_cells(grids, source_row[..., :, None], source_column[..., None, :])


def cells_before_turn(
    cosine: Tensor, sine: Tensor, pivot: tuple[float, float], size: tuple[int, int]
) -> tuple[Tensor, Tensor]:
    """Find where cells were before content was turned counterclockwise, seen from above, about a point.

    A cell takes the class of the cell that its middle comes from, worked out in the precision of the angles.

    Args:
        cosine: of the angles (...).
        sine: of the angles (...).
        pivot: row and column that stay in place; cells have their middles at whole numbers.
        size: rows H and columns W of a grid.

    Returns:
        Row and column, (..., H, W) each, which may lie outside the grid.
    """
    down, right = (
        torch.arange(count, dtype=cosine.dtype, device=cosine.device) - middle
        for count, middle in zip(size, pivot, strict=True)
    )
    cosine, sine, down = cosine[..., None, None], sine[..., None, None], down[:, None]
    row = torch.floor(cosine * down + sine * right + pivot[0] + 0.5).long()
    column = torch.floor(cosine * right - sine * down + pivot[1] + 0.5).long()
    return row, column


def take_cells(grids: Tensor, row: Tensor, column: Tensor) -> Tensor:
    """Take the classes of other cells of the same grid, unknown from outside it.

    (..., H, W) by rows and columns that broadcast to it -> (..., H, W).
    """
    rows, columns = grids.shape[-2:]
    inside = ((row >= 0) & (row < rows)) & ((column >= 0) & (column < columns))
    source = row.clamp(0, rows - 1) * columns + column.clamp(0, columns - 1)
    flat = grids.flatten(-2)
    taken = flat.gather(-1, source.flatten(-2).expand(flat.shape)).reshape(grids.shape)
    return taken.masked_fill_(~inside, UNKNOWN)  # `torch.where` with a number waits for the device


def covered_without_truth(aligned: Tensor, target: Tensor) -> Tensor:
    """Compute the mask M: aligned (B, S, T, H, W) and target (B, H, W) -> (B, H, W) bool.

    The paper's M = M_covered - M_target; the target's own cells of M_covered cancel out.
    """
    return (aligned != UNKNOWN).flatten(1, 2).any(dim=1) & (target == UNKNOWN)
