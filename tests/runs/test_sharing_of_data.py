"""Rows that share data: their grids are built once and their logs read once, however many rows there are."""

from collections import Counter

import pytest
import yaml
from support.toy_world import street

from semgrid_eval.grids import build
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix

ED = {"features": 4, "depth": 2, "training": {"epochs": 1, "updates_per_epoch": 2, "batch": 2}}
ROWS = (
    {"name": "BL", "model": "newest"},
    {"name": "BL-still", "model": "newest", "translate": False},
    {"name": "BL-Table", "model": "table"},
    {"name": "ED", "model": "ed", "settings": ED},
    {"name": "BL-Crop", "model": "newest", "sensors": ["split2_upper", "split2_lower"]},
)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for i, split in enumerate(("train", "val", "val")):
        write_log(street(i, frames=9).recording(f"toy_{i:06}_000000", split), folder / split / f"toy{i}.mcap")
    return folder


@pytest.fixture
def counted(logs, tmp_path, monkeypatch):
    """Run rows in a place of their own; count the grids that are built, and the passes over messages of each log."""

    def run(rows, place):
        built, read = Counter(), Counter()
        make, pass_over = build.build_log, LogReader.messages

        def build_log(log, config):
            built[log.name, str(config)] += 1
            return make(log, config)

        def messages(reader, *given, **named):
            read[reader.path.name] += 1
            return pass_over(reader, *given, **named)

        with monkeypatch.context() as patch:
            patch.setattr(build, "build_log", build_log)
            patch.setattr(LogReader, "messages", messages)
            window = {"step_frames": 1, "horizon_steps": 1, "target_frame": 6}
            path = tmp_path / "matrix.yaml"
            path.write_text(yaml.safe_dump({"defaults": {"window": window}, "rows": list(rows)}))
            options = RunOptions("cpu", tmp_path / place / "grids", "test")
            record = run_matrix(load_matrix(str(path)), logs, tmp_path / place / "run", options)
        assert [row.failure for row in record.rows] == [None] * len(rows)
        return built, read

    return run


def test_a_row_more_builds_no_grid_again_and_reads_no_log_again(counted):
    built, read = counted(ROWS, "all")
    assert set(built.values()) == {1}
    assert {name for name, _ in built} == {"toy0.mcap", "toy1.mcap", "toy2.mcap"}
    assert set(read) == {"toy0.mcap", "toy1.mcap", "toy2.mcap"}
    assert (built, read) == counted(ROWS[2:3], "one")


def test_a_row_that_is_added_later_builds_nothing_and_reads_but_the_log_that_shows_what_there_is(counted):
    counted(ROWS[1:3], "later")
    built, read = counted(ROWS[:3], "later")
    assert (built, set(read)) == (Counter(), {"toy0.mcap"})
