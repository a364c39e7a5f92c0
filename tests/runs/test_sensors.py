"""The preset `sensors` on a small drive with all sensors: one target for all rows, and lost sensors."""

from dataclasses import replace

import numpy as np
import pytest
from support.commands import run_command
from support.towns import small_plans

from semgrid_eval.log.store import write_log
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.scores import results
from semgrid_eval.sources.town.rendering import render_recording

pytestmark = pytest.mark.slow

ALL = ["front", "left", "right", "rear", "lidar"]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Run the rows without training: their results by name, and what each predicted and saw."""
    folder = tmp_path_factory.mktemp("sensors")
    plan = replace(small_plans()[-1], rig="surround+lidar")
    write_log(render_recording(plan), folder / "logs" / plan.split / f"{plan.name}.mcap")
    words = ["run", "sensors", "--logs", f"{folder}/logs", "--row", "BL-*", "--out", f"{folder}/run"]
    ended = run_command(words)
    assert ended.code == 0, ended.err
    found = {}
    for row in results.read_run(folder / "run").rows:
        if row.results:
            result = results.read_result(results.result_folder(folder / "run", row.results[0]))
            found[row.name] = result, results.read_windows(folder / "run", result.windows_id)
    return found


def test_all_rows_share_one_target_of_all_sensors(done):
    assert len(done) == 12
    assert len({result.targets for result, _ in done.values()}) == 1
    targets = {windows["target"].tobytes() for _, windows in done.values()}
    assert len(targets) == 1
    result, windows = done["BL-Fuse all"]
    assert result.config["grid"]["target"] == ALL
    known = (windows["target"] != 0).mean()
    assert all(known >= (windows["inputs"][:, row, -1] != 0).mean() for row in range(len(ALL)))


def test_grids_are_all_around_the_vehicle(done):
    _, windows = done["BL-Fuse all"]
    newest = windows["inputs"][0, :, -1] != 0
    ahead, behind = newest[:, :64].sum(axis=(1, 2)), newest[:, 64:].sum(axis=(1, 2))
    for name, few, many in (("front", behind, ahead), ("rear", ahead, behind)):
        assert few[ALL.index(name)] < 0.02 * many[ALL.index(name)]
    assert min(ahead[4], behind[4]) > 500


def test_what_is_lost_is_unknown_and_what_is_left_scores_as_if_it_were_alone(done):
    _, lost = done["BL-Fuse all, LiDAR lost"]
    _, whole = done["BL-Fuse all"]
    assert not lost["inputs"][:, ALL.index("lidar")].any()
    np.testing.assert_array_equal(lost["inputs"][:, :4], whole["inputs"][:, :4])
    np.testing.assert_array_equal(lost["mask"], whole["mask"])
    _, front = done["BL-Fuse all, front camera alone"]
    assert front["inputs"][:, 0].any()
    assert not front["inputs"][:, 1:].any()


def test_rows_with_a_lost_sensor_share_the_training_of_the_row_without():
    rows = {row.name: row for row in load_matrix("sensors").rows}
    for model in ("RN", "ED"):
        for lost in ("LiDAR lost", "front camera alone"):
            row, whole = rows[f"{model} all, {lost}"], rows[f"{model} all"]
            assert row.disturb is not None
            assert row.model_copy(update={"disturb": None, "name": whole.name}) == whole
