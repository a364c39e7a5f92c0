"""Streets with cars as grids, drawn by chance: what a sensor saw of them at three times, and what was there."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN

SIDE = 128
Grid = NDArray[np.uint8]
ID = {name: index for index, name in enumerate(CLASS_NAMES)}


def scene(rng: np.random.Generator, step: int) -> tuple[list[Grid], Grid, Grid, list[NDArray[np.bool_]]]:
    """Two aligned inputs, the target as the sensor sees it, the world behind it, and where cars moved and stood."""
    world = _street(rng)
    cars = [(int(rng.integers(10, 100)), int(rng.choice([-6, -3, 2, 5])), int(rng.integers(-5, 6))) for _ in range(5)]
    frames = [_with_cars(world, cars, when + step) for when in (-2, -1, 0)]
    seen = [
        np.where(seen_from(rng, back), frame, UNKNOWN).astype(np.uint8)
        for frame, back in zip(frames, (10, 5, 0), strict=True)
    ]
    inputs, target = [_flicker(rng, s) for s in seen[:2]], _flicker(rng, seen[2])
    moving = _near_cars([car for car in cars if car[2] != 0], step)
    return inputs, target, frames[2], [moving, _near_cars([car for car in cars if car[2] == 0], step) & ~moving]


def _street(rng: np.random.Generator) -> Grid:
    world = np.full((SIDE, SIDE), ID["building"], np.uint8)
    world[:, 20:108][rng.random((SIDE, 88)) < 0.02] = ID["vegetation"]
    rows, slope = np.arange(SIDE), rng.uniform(-0.25, 0.25)
    centre = 64 + slope * (SIDE - rows) + 3 * np.sin(rows / 20)
    across = np.abs(np.arange(SIDE)[None] - centre[:, None])
    world[(across > 18) & (across < 26) & (np.sin(rows / 9)[:, None] > 0)] = ID["vegetation"]
    world[across < 15] = ID["sidewalk"]
    world[across < 10] = ID["road"]
    for _ in range(6):
        row = int(rng.integers(4, SIDE - 4))
        side = int(centre[row] + rng.choice([-12, 12]))
        kind = rng.choice(["person", "pole_sign", "bicycle"])
        world[row : row + 2, side : side + 2] = ID[str(kind)]
    return world


def _with_cars(world: Grid, cars: list[tuple[int, int, int]], when: int) -> Grid:
    frame = world.copy()
    for index, (row, offset, speed) in enumerate(cars):
        top, left = max(0, row + speed * when), 64 + offset
        frame[top : top + 6, left : left + 3] = ID["large_vehicle" if index == 4 else "car"]
    return frame


def _near_cars(cars: list[tuple[int, int, int]], when: int) -> NDArray[np.bool_]:
    """The cells within one of a car's place at the target's time, or at the newest input's."""
    near = np.zeros((SIDE, SIDE), bool)
    for row, offset, speed in cars:
        for top in (max(0, row + speed * when), max(0, row + speed * (when - 1))):
            near[max(0, top - 1) : top + 7, 63 + offset : 68 + offset] = True
    return near


def seen_from(rng: np.random.Generator, back: int) -> NDArray[np.bool_]:
    rows, columns = np.mgrid[0:SIDE, 0:SIDE]
    ahead = SIDE - 1 - rows + back - 6
    wide = np.abs(columns - 64) < 0.42 * ahead
    shadow = np.abs(columns - rng.integers(30, 98)) < 0.06 * ahead - 2
    return wide & ~shadow & (ahead > 4)


def _flicker(rng: np.random.Generator, grid: Grid) -> Grid:
    blocks = np.kron(rng.random((SIDE // 2, SIDE // 2)) < 0.03, np.ones((2, 2), bool))
    return np.where(blocks, UNKNOWN, grid).astype(np.uint8)
