"""Groups of the training logs that are held out: scored, and not trained on; and one training for several leads."""

import shutil
from copy import deepcopy
from dataclasses import replace

import pytest
from support.small_runs import WINDOW, run
from support.toy_world import street

from semgrid_eval.log.store import write_log
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Write logs of two towns to train on, and of a third to score."""
    folder = tmp_path_factory.mktemp("logs")
    for i, (group, split) in enumerate((("a", "train"), ("b", "train"), ("c", "val"))):
        write_log(town(group, i, split), folder / f"{group}.mcap")
    return folder


def town(group, seed, split):
    return replace(street(seed, frames=9, speed_mps=8 + seed).recording(f"{group}_{seed}", split), group=group)


def scored(out, row):
    return results.read_result(results.result_folder(out, row.results[0]))


def test_groups_held_out_are_scored_and_not_trained_on(logs, tmp_path):
    rows = [{"name": "BL-Table", "model": "table", "hold_out": ["b"]}, {"name": "all", "model": "table"}]
    held, whole = run(rows, logs, tmp_path / "run").rows
    assert [window.recording for window in scored(tmp_path / "run", held).windows] == ["b_1"]
    assert [window.recording for window in scored(tmp_path / "run", whole).windows] == ["c_2"]
    # So it is as if they were another split.
    (tmp_path / "logs").mkdir()
    shutil.copy(logs / "a.mcap", tmp_path / "logs")
    write_log(town("b", 1, "val"), tmp_path / "logs" / "b.mcap")
    (split,) = run([{"name": "BL-Table", "model": "table"}], tmp_path / "logs", tmp_path / "split").rows
    sums = [
        read_sums(results.result_folder(tmp_path / out, row.results[0]), "iou", "all")
        for out, row in (("run", held), ("split", split))
    ]
    assert (sums[0] == sums[1]).all()


def test_a_group_that_no_recording_has_fails_the_row_alone(logs, tmp_path):
    rows = [{"name": "wrong", "model": "newest", "hold_out": ["d"]}, {"name": "BL", "model": "newest"}]
    wrong, right = run(rows, logs, tmp_path / "run").rows
    assert wrong.failure is not None
    assert "no recording of split 'train' is of the group 'd' (groups found: a, b)" in wrong.failure
    assert right.failure is None


@pytest.mark.slow
def test_rows_that_differ_in_the_horizon_share_a_training_of_mixed_leads(logs, tmp_path):
    base = {"model": "residual", "train_leads": [1, 6], "window": {**WINDOW, "inputs": 1}}
    settings = {"widths": [4, 4], "fine": 0, "lead_input": True}
    settings["training"] = {"epochs": 1, "updates_per_epoch": 2, "batch": 2, "precision": "float32"}
    rows = [
        {
            **deepcopy(base),
            "name": f"RN-{steps}",
            "settings": deepcopy(settings),
            "window": {**base["window"], "horizon_steps": steps},
        }
        for steps in (1, 2)
    ]
    one, two = run(rows, logs, tmp_path / "run").rows
    assert (one.failure, two.failure) == (None, None)
    assert len(list((tmp_path / "run" / "trainings").iterdir())) == 1
    leads = [scored(tmp_path / "run", row).lead_s for row in (one, two)]
    assert leads[1] == pytest.approx(2 * leads[0], abs=1e-5)


def test_leads_that_reach_before_the_recording_are_refused(logs, tmp_path):
    rows = [{"name": "RN", "model": "residual", "train_leads": [1, 9]}]
    with pytest.raises(Exception, match="train_leads: reach back 12 frames, and target_frame is 8"):
        run(rows, logs, tmp_path / "run")
