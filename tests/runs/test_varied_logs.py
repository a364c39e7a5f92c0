"""A data set whose logs have cameras of their own: checked, made into grids, scored, trained on, shown and played."""

import json
from dataclasses import replace
from functools import partial
from itertools import islice

import pytest
import yaml
from click.testing import CliRunner
from mcap.reader import make_reader
from support.towns import small_plans

from semgrid_eval.cli.main import cli
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, write_log
from semgrid_eval.scores.results import read_run
from semgrid_eval.scores.thumbnails import pictures_file, read_pictures
from semgrid_eval.sources.town.rendering import render_recording

FRAMES, WINDOW = 9, {"step_frames": 3, "target_frame": 8}
AUGMENT = {"flip": 0.5, "rotate_deg": 2, "misalign_cells": 1}
TRAINING = {"epochs": 1, "updates_per_epoch": 2, "batch": 2, "schedule": {"drop_epoch": None}, "augment": AUGMENT}
ROWS = [
    {"name": "BL-DC", "model": "newest"},
    {"name": "BL-Sp2", "model": "overlay", "sensors": ["split2_upper", "split2_lower"]},
    {"name": "ED-NT", "model": "ed", "translate": False, "settings": {"features": 4, "training": TRAINING}},
]


def call(*arguments):
    result = CliRunner().invoke(cli, [str(argument) for argument in arguments], standalone_mode=False)
    assert result.exception is None, result.output
    assert not result.return_value, result.output
    return result


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with varied logs, two a split, and a run over them."""
    place = tmp_path_factory.mktemp("varied")
    for plan in small_plans(errors="varied", val_share=0.5):
        recording = render_recording(plan)
        few = replace(recording, moments=partial(islice, recording.moments(), FRAMES))
        write_log(few, place / "logs" / plan.split / f"{plan.name}.mcap")
    (place / "m.yaml").write_text(yaml.safe_dump({"defaults": {"window": WINDOW}, "rows": ROWS}))
    call("run", place / "m.yaml", "--logs", place / "logs", "--out", place / "run", "--device", "cpu", "--workers", 1)
    return place


def cameras(place):
    """Width, height and focal length by log, as the logs' metadata say."""
    found = {}
    for log in find_logs(place / "logs"):
        with LogReader(log) as reader:
            conditions = reader.conditions()
        found[log] = tuple(conditions[f"camera.{name}"].value for name in ("width_px", "height_px", "fx_px"))
    return found


def test_every_log_has_a_camera_of_its_own_and_is_sound(place):
    assert len(set(cameras(place).values())) == 4
    checked = json.loads(call("check", "--json", place / "logs").stdout)["logs"]
    assert all(log["good"] for log in checked)
    assert [log["findings"] for log in checked] == [[]] * 4
    widths = [log["conditions"]["camera.width_px"] for log in checked]
    assert widths == [{"value": width, "unit": "px"} for width, _, _ in cameras(place).values()]


def test_every_row_has_a_result_over_all_logs(place):
    record = read_run(place / "run")
    assert [row.failure for row in record.rows] == [None] * 3
    assert len(record.logs) == 4


def test_pictures_have_the_shape_of_their_log(place):
    shapes = set()
    for log, (width, height, _) in cameras(place).items():
        with LogReader(log) as reader:
            file = pictures_file(place / "run", reader.digest, GridConfig())
        if log.parent.name == "val":
            pictures = read_pictures(file)
            assert all(frame.image and frame.label for frame in pictures.frames.values())
            shapes.add((width, height))
            # The point 10 m ahead on the ground lies inside a picture whose sides are 1 long.
            u, v, w = pictures.track.projection @ [10.0, 0.0, 0.0, 1.0]
            assert 0.4 < u / w < 0.6
            assert 0.4 < v / w < 1.0
    assert len(shapes) == 2


@pytest.mark.slow
def test_a_report_is_written_and_every_recording_played(place):
    call("report", place / "run")
    assert (place / "run" / "report" / "index.html").stat().st_size > 10_000
    call("play", place / "run", "ED-NT", "--logs", place / "logs", "--all", "--out", place / "play.mcap")
    with (place / "play.mcap").open("rb") as stream:
        topics = {channel.topic for channel in make_reader(stream).get_summary().channels.values()}
    assert {
        "/grid/prediction/1",
        "/grid/certainty/1",
        "/grid/legend",
        "/camera/front/image",
        "/camera/front/calibration",
    } <= topics
