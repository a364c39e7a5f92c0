"""Where the cells of all recordings lie: on a device, in memory, or in a file that is mapped into memory."""

import math
import mmap
import os
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.files import unnamed_file, writing
from semgrid_eval.progress import Progress, Stage, silent_stage

if TYPE_CHECKING:  # building grids needs the log readers; using built ones does not
    from semgrid_eval.grids.recording import RecordingGrids

_OPEN_FILES = Path("/proc/self/fd")  # where Linux lets other processes open what this one has open
Shape = tuple[int, int, int, int]


@dataclass(frozen=True)
class Storage:
    """Where cells are put: on a device; for the CPU into a file in `folder`, or into memory where none is given."""

    device: torch.device
    folder: Path | None = None
    stage: Stage = silent_stage  # shows how far the cells are gathered, when they are asked for


class Block(Protocol):
    """The grids of all recordings as one tensor."""

    shape: Shape  # S, F, H, W
    device: torch.device

    @property
    def tensor(self) -> Tensor:
        """Return the class ids (S, F, H, W) uint8."""


class HeldBlock:
    """A tensor that is there."""

    def __init__(self, tensor: Tensor) -> None:
        sensors, frames, rows, columns = tensor.shape
        self.shape: Shape = (sensors, frames, rows, columns)
        self.tensor, self.device = tensor, tensor.device


class GatheredBlock:
    """Cells that are gathered, one recording after the other, when they are first asked for.

    The file of a `Storage` has no name, so that it is gone with the process, however that ends. A process that is sent
    the block maps the same file, where the system lets it.
    """

    def __init__(self, recordings: Sequence["RecordingGrids"], sensors: Sequence[str], storage: Storage) -> None:
        self._recordings, self._sensors, self._stage = recordings, sensors, storage.stage
        self._folder = storage.folder if storage.device.type == "cpu" else None
        self._file: BinaryIO | None = None
        frames = sum(len(recording.stamps_ns) for recording in recordings)
        self.shape: Shape = (len(sensors), frames, *recordings[0].size)
        self.device = storage.device

    @cached_property
    def tensor(self) -> Tensor:
        """Return the class ids (S, F, H, W) uint8.

        Raises:
            ResultError: the file of a recording is gone or damaged.
            InputError: there is no room for the file that is mapped.
        """
        with self._stage("gather") as progress:
            found = self._held(progress) if self._folder is None else self._mapped(self._folder, progress)
        self._recordings = ()
        return found

    def _held(self, progress: Progress) -> Tensor:
        grids = torch.empty(self.shape, dtype=torch.uint8, device=self.device)
        for row, first, cells in self._parts(progress):
            grids[row, first : first + len(cells)] = torch.from_numpy(cells)
        return grids

    def _mapped(self, folder: Path, progress: Progress) -> Tensor:
        file = unnamed_file(folder, math.prod(self.shape))
        with ExitStack() as stack:
            stack.callback(file.close)
            self._write(file, folder, progress)
            found = _map(file, self.shape)
            stack.pop_all()
        self._file = file
        weakref.finalize(self, file.close)
        return found

    def _write(self, file: BinaryIO, folder: Path, progress: Progress) -> None:
        _, frames, rows, columns = self.shape
        for row, first, cells in self._parts(progress):
            with writing(folder):
                file.seek((row * frames + first) * rows * columns)
                file.write(cells.data)
                file.flush()

    def _parts(self, progress: Progress) -> Iterator[tuple[int, int, NDArray[np.uint8]]]:
        first = 0
        for done, recording in enumerate(self._recordings, start=1):
            for row, name in enumerate(self._sensors):
                yield row, first, np.ascontiguousarray(recording.cells(name))
            first += len(recording.stamps_ns)
            progress(done, len(self._recordings), recording.name)

    def __reduce__(self) -> tuple[Callable[..., Block], tuple[object, ...]]:
        """Send the place of the file instead of its content."""
        tensor = self.tensor
        if self._file is None or not _OPEN_FILES.is_dir():
            return HeldBlock, (tensor,)
        return _mapped_block, (f"/proc/{os.getpid()}/fd/{self._file.fileno()}", self.shape)


def _mapped_block(path: str, shape: Shape) -> Block:
    """Map the file that another process has open."""
    with Path(path).open("r+b") as file:
        return HeldBlock(_map(file, shape))


def _map(file: BinaryIO, shape: Shape) -> Tensor:
    return torch.frombuffer(mmap.mmap(file.fileno(), 0), dtype=torch.uint8).view(shape)
