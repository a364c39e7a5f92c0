"""Rows with disturbed inputs in a run: one training and one set of targets for all that is wrong with the inputs."""

import numpy as np
import pytest
from support.small_runs import run

from semgrid_eval.errors import ConfigError
from semgrid_eval.executors import InProcess
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.row import units_of
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import SUMS_FILE, read_sums

pytestmark = pytest.mark.slow

KINDS = {
    "lost": {"kind": "lost_frame"},
    "patches": {"kind": "mislabelled", "strength": 0.3},
    "yaw": {"kind": "yaw_rate_bias", "strength": 40},
    "late": {"kind": "late_input", "strength": 2},
    "reversed": {"kind": "reversed_order"},
}
MODELS = {"BL": "newest", "ED": "ed"}
ROWS = [{"name": name, "model": model} for name, model in MODELS.items()] + [
    {"name": f"{name}-{kind}", "model": MODELS[name], "disturb": dict(disturb)}
    for kind, disturb in KINDS.items()
    for name in (("BL", "ED") if kind in ("lost", "late") else ("BL",))
]


@pytest.fixture(scope="module")
def done(logs, tmp_path_factory):
    """Run every kind with a baseline and a trained row: the folder and its results by row."""
    out = tmp_path_factory.mktemp("runs") / "run"
    record = run(ROWS, logs, out)
    assert {row.name: row.failure for row in record.rows} == dict.fromkeys(row["name"] for row in ROWS)
    return out, {row.name: results.read_result(results.result_folder(out, row.results[0])) for row in record.rows}


def test_disturbed_rows_share_targets_and_mask_with_the_undisturbed_one_and_have_other_results(done):
    out, found = done
    assert {result.targets for result in found.values()} == {found["BL"].targets}
    assert len({result.id for result in found.values()}) == len(ROWS)
    windows = {name: results.read_windows(out, result.windows_id) for name, result in found.items()}
    for arrays in windows.values():
        for name in ("target", "mask"):
            np.testing.assert_array_equal(arrays[name], windows["BL"][name])
    inputs = {name: arrays["inputs"].tobytes() for name, arrays in windows.items() if name.startswith("BL")}
    assert len(set(inputs.values())) == len(inputs), "what a row saw is kept"
    assert windows["ED-late"]["inputs"].tobytes() == inputs["BL-late"]


def test_cells_are_divided_by_what_was_to_be_seen(done):
    out, found = done
    regions = {
        name: read_sums(results.result_folder(out, result.id), "iou", "origin").sum(axis=(3,))
        for name, result in found.items()
    }
    for counted in regions.values():
        np.testing.assert_array_equal(counted, regions["BL"])


def test_a_model_is_trained_once_whatever_is_wrong_with_the_inputs_that_are_scored(done):
    out, found = done
    assert len(list((out / "trainings").glob("*/history.csv"))) == 1
    histories = {name: results.read_history(results.result_folder(out, found[name].id)) for name in ("ED", "ED-lost")}
    assert histories["ED"].equals(histories["ED-lost"])


def test_the_newest_input_is_all_that_its_copy_has(done):
    out, found = done
    counts = {name: read_sums(results.result_folder(out, found[name].id), "iou", "all")[:, 0] for name in found}
    assert counts["BL-lost"][:, :, 1:].sum() == 0
    assert counts["BL"].trace(axis1=1, axis2=2).sum() > counts["BL-late"].trace(axis1=1, axis2=2).sum()


def test_the_same_command_gives_the_same_numbers(done, logs, tmp_path):
    out, found = done
    rows = [row for row in ROWS if row["model"] == "newest"]
    run(rows, logs, tmp_path / "again")
    for name in (row["name"] for row in rows):
        (first, second) = (results.result_folder(folder, found[name].id) for folder in (out, tmp_path / "again"))
        assert (first / SUMS_FILE).read_bytes() == (second / SUMS_FILE).read_bytes()


def trainings(logs, out, rows, names):
    """Resolve rows of a preset on small logs, and return the ids of their trainings."""
    matrix = load_matrix(rows)
    worker = make_worker(matrix, logs, out, RunOptions("cpu", out / "grids", "test", (), InProcess()), silent_stage)
    window = {"step_frames": 3, "target_frame": 8}
    found = set()
    for row in matrix.rows:
        if row.name in names:
            small = row.model_copy(update={"window": row.window.model_copy(update=window)})
            ((_, unit),) = units_of(small, matrix.seed)
            found.add(worker.look(unit.row, unit.seed).training.id)
    return found


def test_the_preset_s_disturbed_rows_find_the_training_of_paper_cpu(logs, tmp_path):
    disturbed = [row.name for row in load_matrix("disturb").rows if row.model == "ed"]
    assert len(disturbed) == 10
    (one,) = trainings(logs, tmp_path, "disturb", disturbed)
    assert trainings(logs, tmp_path, "paper-cpu", ["ED-DC"]) == {one}


def test_strengths_are_an_axis_and_names_are_filled_in(tmp_path):
    (tmp_path / "m.yaml").write_text("""
rows:
  - name: "late-{disturb.strength}"
    model: newest
    disturb: {kind: late_input}
    axes: {grid: {disturb.strength: [1, 4]}}
""")
    rows = load_matrix(str(tmp_path / "m.yaml")).rows
    assert [(row.name, row.disturb.strength, row.facts.disturbed) for row in rows] == [
        ("late-1", 1, "inputs 1 frame late"),
        ("late-4", 4, "inputs 4 frames late"),
    ]
    assert rows[1].label.endswith("1 step of 5 frames ahead, inputs 4 frames late)")


@pytest.mark.parametrize(
    ("disturb", "message"),
    [
        ("{kind: fog}", "disturb: kind: 'fog' is not one of lost_frame, lost_sensor, mislabelled"),
        ("{strength: 1}", "disturb: kind: is missing; it is one of"),
        ("{kind: late_input, delay: 3}", "disturb: delay: unknown key; allowed here: kind, seed, strength"),
        ("{kind: late_input, strength: 0.5}", r"disturb\.strength: .*not 0\.5"),
        ("{kind: mislabelled, strength: 2}", r"disturb\.strength: .*not 2"),
        ("{kind: lost_frame, which: middle}", r"disturb\.which: 'middle' is not one of"),
    ],
)
def test_faults_name_the_row_and_the_key(tmp_path, disturb, message):
    (tmp_path / "m.yaml").write_text(f"rows: [{{name: a, model: newest, disturb: {disturb}}}]")
    with pytest.raises(ConfigError, match=r"m\.yaml: row 'a': " + message):
        load_matrix(str(tmp_path / "m.yaml"))


def test_a_row_that_is_told_of_the_truth_has_no_inputs_to_disturb(tmp_path):
    (tmp_path / "m.yaml").write_text("rows: [{name: a, model: true_motion, disturb: {kind: reversed_order}}]")
    with pytest.raises(ConfigError, match="a row that is told of the truth has no inputs to disturb"):
        load_matrix(str(tmp_path / "m.yaml"))


def test_a_row_whose_inputs_are_right_is_digested_as_before_there_were_disturbances():
    (row,) = (row for row in load_matrix("paper").rows if row.name == "BL-DC")
    assert "disturb" not in row.identity()
