"""What every kind of disturbance shares: settings in a row, and the inputs that it changes."""

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.grids import GridData


@dataclass(frozen=True)
class Inputs:
    """The inputs of B windows as they were recorded, not moved yet, and what they come from; frames are along F."""

    data: GridData
    spec: GridSpec  # of its grids
    sensor_rows: Tensor  # (S,) int64 where the sensors lie in the data
    frames: NDArray[np.int64]  # (B, T) oldest first
    target_frames: NDArray[np.int64]  # (B,)
    grids: Tensor  # (B, S, T, H, W) uint8 class ids
    shift_cells: Tensor  # (B, T, 2) int64 rows and columns by which ego motion moves each input into the target's place
    lead_s: Tensor  # (B, T) float32 time from each input to the target

    def generators(self, seed: int) -> list[np.random.Generator]:
        """Return a generator for each of the B windows: one window draws the same whichever others there are."""
        owners, _ = self.data.locate(self.target_frames)
        keys = (
            (seed, self.data.digests[owner], int(self.data.stamps_ns[target]))
            for owner, target in zip(owners, self.target_frames, strict=True)
        )
        return [np.random.default_rng(list(hashlib.sha256(repr(key).encode()).digest())) for key in keys]

    def drawn(self, share: float, seed: int) -> NDArray[np.bool_]:
        """Draw a share of the windows, one by one: (B,)."""
        return np.array([generator.random() < share for generator in self.generators(seed)])


def in_windows(share: float) -> str:
    """Say, behind what is wrong, in which share of the windows it is; nothing where it is in all."""
    return "" if share == 1 else f" in {100 * share:g}% of the windows"


class Disturbance(Config, ABC):
    """Settings of a disturbance: what is wrong with the inputs of the windows that are scored.

    Training, targets and mask M stay as they are, so that a row can be subtracted from the undisturbed one.
    """

    kind: str  # one of `semgrid_eval.windows.disturb.kinds.KINDS`
    strength: float  # how wrong it is, in what the kind says
    seed: int = Field(0, ge=0)  # of what is drawn; a kind without chance has no use for it

    @property
    @abstractmethod
    def words(self) -> str:
        """Say what is wrong: `newest input lost`."""

    @abstractmethod
    def apply(self, inputs: Inputs) -> Inputs:
        """Return the inputs as a model sees them."""

    def check(self, inputs: int, sensors: tuple[str, ...]) -> None:
        """Refuse a number of inputs, or sensors, that cannot be disturbed like this, by a ValueError."""
