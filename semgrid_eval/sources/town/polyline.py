"""Places along a line: position and direction at any distance from its start."""

from dataclasses import dataclass

import numpy as np

from semgrid_eval.geometry import Floats


@dataclass(frozen=True)
class Polyline:
    """A line through points (N, 2); distances along it run from 0 to `length_m`."""

    points_m: Floats
    distances_m: Floats

    @classmethod
    def through(cls, points_m: Floats) -> "Polyline":
        """Return the line through points (N, 2); repeated points are left out."""
        steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
        keep = np.append(True, steps > 1e-6)
        kept = points_m[keep]
        return cls(kept, np.append(0.0, np.cumsum(np.linalg.norm(np.diff(kept, axis=0), axis=1))))

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.distances_m[-1])

    def at(self, distance_m: float, left_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y and yaw at a distance along the line and an offset to its left."""
        segment = int(np.clip(np.searchsorted(self.distances_m, distance_m, "right") - 1, 0, len(self.points_m) - 2))
        start, end = self.points_m[segment], self.points_m[segment + 1]
        ahead = (end - start) / np.linalg.norm(end - start)
        x_m, y_m = start + (distance_m - self.distances_m[segment]) * ahead + left_m * np.array([-ahead[1], ahead[0]])
        return float(x_m), float(y_m), float(np.arctan2(ahead[1], ahead[0]))

    def piece(self, start_m: float, end_m: float, left_m: float = 0.0) -> Floats:
        """Return the points (M, 2) of the line between two distances, moved to its left."""
        inside = self.distances_m[(self.distances_m > start_m) & (self.distances_m < end_m)]
        return np.array([self.at(float(s), left_m)[:2] for s in (start_m, *inside, end_m)])
