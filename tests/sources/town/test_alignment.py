"""Grids of a town with exact labels and depth, moved by the reported motion, fall onto each other."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from support.towns import small_plans

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.store import write_log
from semgrid_eval.sources.town.drives import ego_path
from semgrid_eval.sources.town.rendering import render_recording
from semgrid_eval.sources.town.town import load_town

STATIC = [CLASS_NAMES.index(name) for name in ("road", "sidewalk", "building", "vegetation", "pole_sign")]
CELL_M = 100.0 / 128
FRAMES = 18


def travelled_m(plan) -> float:
    path = ego_path(load_town(plan.town).traffic, plan.drive)
    return float(np.linalg.norm(np.subtract(path.at(plan.drive.start_s + 1.7)[:2], path.at(plan.drive.start_s)[:2])))


@pytest.fixture(scope="module")
def grids(tmp_path_factory):
    """Two grids of each of the two farthest drives of several, and the cells by which the vehicle moved in between."""
    farthest = sorted(small_plans(recordings=8), key=travelled_m)[-2:]
    assert travelled_m(farthest[0]) > 5.0
    found = []
    for plan in farthest:
        log = tmp_path_factory.mktemp("logs") / "town.mcap"
        recording = render_recording(replace(plan, stereo="exact", width_px=512, height_px=256))
        write_log(replace(recording, moments=lambda start=recording.moments: islice(start(), FRAMES)), log)
        found.append(nearly_whole_cells_apart(build_log(log, GridConfig(integrator="arc"))[0]))
    return found


def nearly_whole_cells_apart(recording):
    """Choose the two frames between which the way is nearest to whole cells, so that rounding it hides nothing."""
    pairs = [(old, new) for old in range(FRAMES) for new in range(old + 6, FRAMES)]
    ways = [(recording.position_m[new] - recording.position_m[old]) / CELL_M for old, new in pairs]
    rests = [np.abs(way - np.rint(way)).max() for way in ways]
    (old, new), way = pairs[int(np.argmin(rests))], ways[int(np.argmin(rests))]
    assert min(rests) < 0.15
    return recording.grids[0, old], recording.grids[0, new], np.rint(way).astype(int)


def agreement(grids, off_row: int = 0, off_column: int = 0) -> float:
    """Share of cells, known and static at both times, that have the same class after moving the older grid."""
    same = known = 0
    for older, newer, (rows, columns) in grids:
        moved = np.zeros_like(older)
        down, right = rows + off_row, columns + off_column  # ahead is up and left is left: what is passed moves down
        source = older[max(-down, 0) : 128 - max(down, 0), max(-right, 0) : 128 - max(right, 0)]
        moved[max(down, 0) : 128 + min(down, 0), max(right, 0) : 128 + min(right, 0)] = source
        both = np.isin(moved, STATIC) & np.isin(newer, STATIC)
        same, known = same + int((moved == newer)[both].sum()), known + int(both.sum())
    assert known > 500
    return same / known


def test_aligned_grids_agree(grids):
    assert agreement(grids) > 0.9


def test_no_other_shift_agrees_better(grids):
    others = [agreement(grids, row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]
    assert agreement(grids) > max(others)
