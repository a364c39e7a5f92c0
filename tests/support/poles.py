"""A row of poles beside the road, and how far from them a grid has found some."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from support.toy_world import Box

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.grids.spec import GridSpec

POLE = CLASS_NAMES.index("pole_sign")


@dataclass(frozen=True)
class Poles:
    """Poles at places of the world, and grids of an extent."""

    places: Sequence[tuple[float, float]]
    spec: GridSpec

    @property
    def boxes(self):
        return [Box("pole", x - 0.15, x + 0.15, y - 0.15, y + 0.15, 3.0) for x, y in self.places]

    def found_m(self, grid):
        """Where a grid has poles: ahead and left of the vehicle."""
        cells = np.argwhere(grid == POLE)
        return (np.array([self.spec.agent_row, self.spec.agent_column]) - 0.5 - cells) * self.spec.cell_m

    def away_m(self, found_m, pose):
        """How far from the nearest pole of the world cells are, seen from a pose, in the axes of the world."""
        found = np.add(found_m, pose[:2])
        return np.hypot(*(found[:, None] - np.array(self.places)[None]).transpose(2, 0, 1)).min(axis=1)
