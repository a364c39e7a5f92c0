"""Grids of draws go the way of measurements: without errors they are the measured grids themselves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.own_classes import FILE
from support.towns import small_plans
from support.toy_world import street

from semgrid_eval.classes import ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.draws import Draws
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.sources.town.rendering import render_recording

CONFIG = GridConfig()
OWN = GridConfig(classes=parse_config(ClassSet, yaml.safe_load(FILE)))
TWO_PARTS = GridConfig(target=("split1_upper", "split1_lower"))


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> dict[str, Path]:
    """A log of the town for each kind of errors."""
    folder, made = tmp_path_factory.mktemp("town"), {}
    for stereo in ("exact", "modelled"):
        plan = small_plans(stereo=stereo)[1]
        made[stereo] = folder / f"{stereo}.mcap"
        write_log(render_recording(plan), made[stereo])
    return made


def times(recording, *windows) -> WindowTimes:
    """Times of windows, each given by the frames of its inputs and, last, of its target."""
    frames, stamps_ns = np.array(windows), recording.stamps_ns
    return WindowTimes(np.repeat(stamps_ns[:1], len(windows)), stamps_ns[frames[:, :-1]], stamps_ns[frames[:, -1]])


@pytest.mark.parametrize("config", [CONFIG, TWO_PARTS, GridConfig(morphology="off", integrator="arc"), OWN])
@pytest.mark.parametrize("continued", [True, False])
def test_without_errors_all_draws_are_the_measured_grid(logs, config, continued):
    recording = build_log(logs["exact"], config)[0]
    asked = times(recording, (5, 10, 15), (10, 20, 29))
    with LogReader(logs["exact"]) as log:
        votes = Draws(3, continued).find(log, config, asked)
    measured = recording.grids[recording.sensors.index(recording.target), [15, 29]]
    assert len(np.unique(measured)) > 2
    np.testing.assert_array_equal(votes, 3 * (measured[:, None] == np.arange(config.classes.count)[:, None, None]))


def test_each_draw_votes_once_in_every_cell_and_draws_differ(logs):
    recording = build_log(logs["modelled"], CONFIG)[0]
    asked = times(recording, (5, 10, 15))
    with LogReader(logs["modelled"]) as log:
        votes, again, fewer = (Draws(count, continued=True).find(log, CONFIG, asked) for count in (5, 5, 2))
    assert (votes.sum(axis=1) == 5).all()
    assert ((votes > 0).sum(axis=1) > 1).any()
    np.testing.assert_array_equal(votes, again)
    assert (fewer <= votes).all(), "the first draws are the same, however many there are"


def test_what_is_known_of_the_errors_fades_with_the_frames_since_the_newest_input(logs):
    recording = build_log(logs["modelled"], CONFIG)[0]
    measured = recording.grids[recording.sensors.index("full"), 24]
    with LogReader(logs["modelled"]) as log:
        found = Draws(15, continued=True).find(log, CONFIG, times(recording, (0, 23, 24), (0, 20, 24), (0, 1, 24)))
    right = [np.take_along_axis(votes, measured[None].astype(int), axis=0).sum() for votes in found]
    assert right[0] > right[1] > right[2]


def test_rows_of_other_inputs_share_what_they_need(logs):
    recording = build_log(logs["exact"], CONFIG)[0]
    two, three = times(recording, (10, 15, 20)), times(recording, (5, 10, 15, 20))
    assert Draws(3, continued=True).needed(two).described() == Draws(3, continued=True).needed(three).described()
    other = times(recording, (5, 10, 20))
    assert Draws(3, continued=True).needed(two).described() != Draws(3, continued=True).needed(other).described()
    assert Draws(3, continued=False).needed(two).described() == Draws(3, continued=False).needed(other).described()


def test_a_log_without_exact_pictures_says_so(logs, tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(frames=9).recording(), path)
    recording = build_log(path, CONFIG)[0]
    with LogReader(path) as log, pytest.raises(UnknownTruthError, match="holds no exact pictures"):
        Draws(3, continued=True).find(log, CONFIG, times(recording, (2, 5, 8)))


@pytest.mark.parametrize("frames", ["input", "target"])
def test_a_time_without_a_frame_of_the_targets_camera_is_named(logs, frames):
    asked = times(build_log(logs["exact"], CONFIG)[0], (5, 10, 15))
    late = {
        "input": replace(asked, inputs_ns=asked.inputs_ns + 1),
        "target": replace(asked, target_ns=asked.target_ns + 1),
    }
    with LogReader(logs["exact"]) as log, pytest.raises(UnknownTruthError, match=r"exact\.mcap: .* no frame at \d+ ns"):
        Draws(3, continued=True).find(log, CONFIG, late[frames])
