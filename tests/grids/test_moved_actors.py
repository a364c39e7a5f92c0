"""Actors that inputs show, moved: against the true boxes at the input's and at the target's time."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from support.drawn_again import write_town_like
from support.own_classes import FILE
from support.towns import small_plans
from support.toy_world import street

from semgrid_eval.classes import CLASS_NAMES, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.moved_actors import MovedActors
from semgrid_eval.grids.spec import MOVING, STANDING, GridConfig
from semgrid_eval.grids.truth import WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.sources.town.rendering import render_recording

CONFIG = GridConfig()
SENSORS = ("full", "split1_lower")
STATIC = [CLASS_NAMES.index(name) for name in ("unknown", "road", "sidewalk", "building", "vegetation", "pole_sign")]
INPUT, TARGET = 10, 25


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Grids of exact pictures, the layers left (S, H, W) and arrived (S, H, W), and everybody at both times."""
    (plan,) = small_plans(stereo="exact", width=256, height=128)[2:3]
    path = tmp_path_factory.mktemp("town") / "town.mcap"
    write_log(render_recording(plan), path)
    recording = build_log(path, CONFIG)[0]
    stamps_ns = recording.stamps_ns
    asked = WindowTimes(stamps_ns[:1], stamps_ns[[[INPUT]]], stamps_ns[[TARGET]])
    with LogReader(path) as log:
        layers = MovedActors(SENSORS).find(log, CONFIG, asked)[0, :, 0]
    return recording, layers[:, 0], layers[:, 1]


def test_only_cells_of_what_can_move_are_left(seen):
    recording, left, _ = seen
    for at, sensor in enumerate(SENSORS):
        grid = recording.grids[recording.sensors.index(sensor), INPUT]
        assert not (left[at] & np.isin(grid, STATIC)).any()
    assert left[0].any()


def test_those_who_are_left_move_and_those_who_stand_stay(seen):
    recording, left, _ = seen
    grid, flags = recording.grids[recording.sensors.index("full"), INPUT], recording.actors[INPUT]
    assert (flags[left[0] > 0] & MOVING).astype(bool).mean() > 0.9
    parked = (flags == STANDING) & ~np.isin(grid, STATIC)
    assert parked.any()
    assert not left[0][parked].any()


def test_whoever_arrives_lies_where_moving_actors_truly_are(seen):
    recording, _, arrived = seen
    there = arrived[0] > 0
    assert there.any()
    assert set(np.unique(arrived)) <= {0, *np.flatnonzero(~np.isin(np.arange(10), STATIC))}
    assert (recording.actors[TARGET][there] & MOVING).astype(bool).mean() > 0.9


def test_of_own_classes_those_that_move_are_moved(seen):
    recording, usual, _ = seen
    config = GridConfig(classes=parse_config(ClassSet, yaml.safe_load(FILE)))
    path, stamps_ns, movable = Path(recording.log), recording.stamps_ns, config.classes.movable
    asked = WindowTimes(stamps_ns[:1], stamps_ns[[[INPUT]]], stamps_ns[[TARGET]])
    with LogReader(path) as log:
        left, arrived = MovedActors(("full",)).find(log, config, asked)[0, 0, 0]
    grid = build_log(path, config)[0].grids[0, INPUT]
    assert left.any()
    assert set(np.unique(grid[left > 0])) <= set(movable)
    assert set(np.unique(arrived)) <= {0, *movable}
    assert ((left > 0) == (usual[0] > 0)).mean() > 0.99


def test_a_log_that_does_not_tell_whom_pixels_show_says_so(tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(frames=9).recording(), path)
    stamps_ns = build_log(path, CONFIG)[0].stamps_ns
    asked = WindowTimes(stamps_ns[:1], stamps_ns[[[2]]], stamps_ns[[8]])
    with LogReader(path) as log, pytest.raises(UnknownTruthError, match="which pixels show whom"):
        MovedActors(("full",)).find(log, CONFIG, asked)


def test_a_sensor_that_shows_nothing_at_an_inputs_time_is_named(tmp_path):
    """As one does whose camera has a clock of its own, when the target's has another."""
    path = write_town_like(tmp_path) / "val" / "toy2.mcap"
    stamps_ns = build_log(path, CONFIG)[0].stamps_ns
    asked = WindowTimes(stamps_ns[:1], stamps_ns[[[2]]] + 1, stamps_ns[[8]])
    with LogReader(path) as log, pytest.raises(UnknownTruthError, match=r"toy2\.mcap: sensor full shows nothing at"):
        MovedActors(("full",)).find(log, CONFIG, asked)
