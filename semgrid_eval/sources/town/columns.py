"""Tables of the town that are kept as arrays: a frozen dataclass names the columns."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Arrays:
    """A dataclass of arrays that is kept in a folder, an array a file."""

    def save(self, folder: Path) -> None:
        """Write one `.npy` file an array."""
        for entry in fields(self):
            np.save(folder / f"{entry.name}.npy", getattr(self, entry.name))

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Map the arrays from disk; only what is touched is read."""
        return cls(*(np.load(folder / f"{entry.name}.npy", mmap_mode="r") for entry in fields(cls)))


@dataclass(frozen=True)
class Columns(Arrays):
    """Arrays (N, ...) of the same N rows."""

    def where(self, keep: NDArray[np.bool_]) -> Self:
        """Return the rows for which `keep` (N,) holds."""
        return type(self)(*(getattr(self, entry.name)[keep] for entry in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return all rows of several tables, in order."""
        return cls(*(np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(cls)))
