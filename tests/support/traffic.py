"""Traffic made by hand: everybody drives straight ahead at a steady speed."""

import numpy as np

from semgrid_eval.sources.town.traffic import Traffic

STEP_S = 0.059


def steady_traffic(
    types: list[int], starts_m: list[tuple[float, float]], speeds_mps: list[float], steps: int = 400
) -> Traffic:
    """Return traffic in which actor k starts with its front at `starts_m[k]` and drives along x."""
    count = len(types)
    times_s = 60.0 + STEP_S * np.arange(steps)
    positions = np.array(starts_m, float)[None] + np.zeros((steps, count, 2))
    positions[..., 0] += np.array(speeds_mps) * (times_s - times_s[0])[:, None]
    return Traffic(
        times_s=times_s,
        offsets=np.arange(steps + 1) * count,
        actor=np.tile(np.arange(count, dtype=np.int32), steps),
        position_m=positions.reshape(-1, 2).astype(np.float32),
        heading_rad=np.zeros(steps * count, np.float32),
        speed_mps=np.tile(np.array(speeds_mps, np.float32), steps),
        actor_types=np.array(types, np.uint8),
    )
