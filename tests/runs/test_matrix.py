"""Matrices as files: axes, defaults, bases, and what is refused."""

import os

import pytest
import yaml
from support.matrices import load, write
from support.own_classes import FILE

from semgrid_eval.errors import ConfigError
from semgrid_eval.runs.matrix import load_matrix


def test_axes_multiply_rows_and_fill_in_names(tmp_path):
    together = {"settings.features": [16, 32], "settings.training.batch": [8, 4]}
    axes = {"grid": {"settings.depth": [2, 3]}, "zip": together}
    row = {"name": "d{settings.depth}-f{settings.features}", "model": "ed", "axes": axes}
    rows = load(tmp_path, {"rows": [row]}).rows
    told = [(r.name, r.settings["depth"], r.settings["features"], r.settings["training"]["batch"]) for r in rows]
    assert told == [
        ("d2-f16", 2, 16, 8),
        ("d2-f32", 2, 32, 4),
        ("d3-f16", 3, 16, 8),
        ("d3-f32", 3, 32, 4),
    ]


def test_an_axis_of_names_fills_a_place_in_the_name_that_is_written(tmp_path):
    together = {"name": ["BL", "ED"], "model": ["newest", "ed"]}
    axes = {"grid": {"window.inputs": [2, 3]}, "zip": together}
    rows = load(tmp_path, {"rows": [{"name": "{name}-SL{window.inputs}", "axes": axes}]}).rows
    told = [(row.name, row.model, row.window.inputs) for row in rows]
    assert told == [("BL-SL2", "newest", 2), ("ED-SL2", "ed", 2), ("BL-SL3", "newest", 3), ("ED-SL3", "ed", 3)]


def test_rows_override_defaults_key_by_key(tmp_path):
    matrix = load(
        tmp_path,
        {
            "defaults": {"window": {"step_frames": 3, "target_frame": None}, "grid": {"morphology": "off"}},
            "rows": [{"name": "a", "model": "newest", "window": {"horizon_steps": 2}}],
        },
    )
    row = matrix.rows[0]
    assert (row.window.step_frames, row.window.horizon_steps, row.grid.morphology) == (3, 2, "off")
    assert row.label == "a (newest input, moved to the target's time, 2 inputs, 2 steps of 3 frames ahead)"


def test_a_name_that_is_neither_file_nor_preset_lists_the_presets():
    with pytest.raises(ConfigError, match=r"papre: is neither a file nor a preset \(.*\); did you mean paper\?$"):
        load_matrix("papre")


def test_a_matrix_extends_another_one_beside_it_key_by_key(tmp_path):
    rows = [{"name": name, "model": "ed", "settings": {"depth": 2}} for name in ("a", "b", "c")]
    base = {"seed": 7, "title": "Base", "models": {"ed": {"features": 8, "training": {"batch": 4}}}, "rows": rows}
    changes = [{"name": "c", "settings": {"features": 16}}, {"name": "d", "model": "ed"}]
    models = {"ed": {"training": {"epochs": 3}}}
    mine = {"extends": "base.yaml", "without": ["b"], "models": models, "defaults": {"repeats": 2}, "rows": changes}
    write(tmp_path, base=base, mine=mine)
    matrix = load_matrix(str(tmp_path / "mine.yaml"))
    assert (matrix.title, matrix.seed) == ("mine", 7)
    assert {(row.settings["training"]["batch"], row.settings["training"]["epochs"]) for row in matrix.rows} == {(4, 3)}
    assert [(row.name, row.settings["depth"], row.settings["features"], row.repeats) for row in matrix.rows] == [
        ("a", 2, 8, 2),
        ("c", 2, 16, 2),
        ("d", 3, 8, 2),
    ]


def test_a_matrix_that_extends_a_preset_changes_a_row_before_its_axes(tmp_path):
    row = {"name": "ED-SL{window.inputs}", "axes": {"grid": {"window.inputs": [2, 3]}}}
    names = [row.name for row in load(tmp_path, {"extends": "paper", "rows": [row]}).rows]
    paper = [row.name for row in load_matrix("paper").rows]
    assert names == [name for name in paper if name not in ("ED-SL4", "ED-SL5")]


def test_a_validation_window_is_as_the_window_where_it_says_nothing(tmp_path):
    row = {
        "name": "n{window.inputs}",
        "model": "newest",
        "validation_window": {"step_frames": 3, "target_frame": None},
        "axes": {"grid": {"window.inputs": [2, 3]}},
    }
    rows = load(tmp_path, {"defaults": {"window": {"horizon_steps": 2}}, "rows": [row]}).rows
    assert [(r.scored_window.inputs, r.scored_window.horizon_steps, r.scored_window.step_frames) for r in rows] == [
        (2, 2, 3),
        (3, 2, 3),
    ]
    assert {r.window.step_frames for r in rows} == {5}


@pytest.mark.parametrize(
    ("mine", "message"),
    [
        ({"extends": "nowhere"}, r"mine\.yaml: extends: .*nowhere is neither a file nor a preset \(.*paper.*\)$"),
        ({"extends": "mine.yaml"}, r"mine\.yaml: extends: 'mine\.yaml' leads back to this file"),
        ({"extends": "back.yaml"}, r"mine\.yaml: extends: 'back\.yaml' leads back to this file"),
        ({"extends": "broken.yaml"}, r"broken\.yaml: row 'a': setings: unknown key"),
        (
            {"extends": "good.yaml", "rows": [{"name": "a", "setings": {}}]},
            r"mine\.yaml: row 'a': setings: unknown key",
        ),
        ({"extends": "good.yaml", "without": ["b"]}, r"mine\.yaml: without: row 'b' is not a, the only choice$"),
        ({"extends": "good.yaml", "without": ["a"]}, r"mine\.yaml: rows: there is no row"),
        (
            {"extends": "good.yaml", "rows": [{"name": "a"}, {"name": "a"}]},
            r"mine\.yaml: row 'a': model: is missing",
        ),
        ({"extends": "good.yaml", "rows": [{"name": "a"}, {"name": "a", "model": "ed"}]}, "'a' is the name of 2 rows"),
        ({"extends": 3}, r"mine\.yaml: extends: must be text"),
        ({"without": ["a"], "rows": [{"name": "a", "model": "ed"}]}, "without: .* there is no `extends`"),
        (
            {"extend": "paper"},
            r"mine\.yaml: extend: unknown key; allowed here: defaults, extends, models, rows,",
        ),
    ],
)
def test_faults_of_extending_name_the_file_that_is_at_fault(tmp_path, mine, message):
    write(
        tmp_path,
        mine=mine,
        back={"extends": "mine.yaml"},
        good={"rows": [{"name": "a", "model": "newest"}]},
        broken={"rows": [{"name": "a", "model": "newest", "setings": {}}]},
    )
    with pytest.raises(ConfigError, match=message):
        load_matrix(str(tmp_path / "mine.yaml"))


def test_a_row_without_sensors_sees_those_of_its_target(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text(
        "rows:\n"
        "  - {name: plain, model: newest}\n"
        "  - name: both\n"
        "    model: newest\n"
        "    grid: {sensors: {left: {camera: left}, right: {camera: right}}, target: [right, left]}\n"
    )
    assert [row.sensors for row in load_matrix(str(file)).rows] == [("full",), ("right", "left")]
    file.write_text("rows: [{name: plain, model: newest, grid: {sensors: {a: {}}}}]")
    with pytest.raises(ConfigError, match="grid: target: 'full' is not a, the only choice"):
        load_matrix(str(file))


@pytest.mark.parametrize("seed", ["-1", str(2**53 + 1), str(2**64), "9" * 5000, "0x" + "f" * 5000])
def test_a_seed_that_no_generator_takes_is_one_line(tmp_path, seed):
    (tmp_path / "m.yaml").write_text(f"seed: {seed}\nrows: [{{name: a, model: newest}}]")
    with pytest.raises(ConfigError) as caught:
        load_matrix(str(tmp_path / "m.yaml"))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_a_batch_beyond_all_memory_is_one_line(tmp_path):
    rows = [{"name": "a", "model": "ed", "settings": {"training": {"batch": 10**9}}}]
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"rows": rows}))
    with pytest.raises(ConfigError, match=r"settings\.training\.batch: must be at most 65536, not 1000000000"):
        load_matrix(str(tmp_path / "m.yaml"))


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_a_matrix_that_is_no_file_is_not_waited_for(tmp_path, make):
    make(tmp_path / "m.yaml")
    with pytest.raises(ConfigError, match=r"m\.yaml: is "):
        load_matrix(str(tmp_path / "m.yaml"))


def test_a_class_set_is_found_beside_the_file_that_names_it(tmp_path):
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "mine.yaml").write_text(FILE)
    (tmp_path / "base" / "b.yaml").write_text(
        "defaults: {grid: {classes: mine.yaml}}\nrows: [{name: a, model: newest}]\n"
    )
    (tmp_path / "m.yaml").write_text(
        "extends: base/b.yaml\nrows: [{name: b, model: fuse, grid: {stretch_frames: 40}}]\n"
    )
    rows = load_matrix(str(tmp_path / "m.yaml")).rows
    assert [row.grid.classes.names[1] for row in rows] == ["drivable", "drivable"]
    assert rows[0].given.classes == rows[1].grid.classes
    assert rows[0].identity()["grid"]["classes"] == rows[0].grid.classes.identity()


def test_rows_of_a_matrix_have_one_class_set(tmp_path):
    (tmp_path / "mine.yaml").write_text(FILE)
    (tmp_path / "m.yaml").write_text(
        "rows: [{name: a, model: newest}, {name: b, model: fuse, grid: {classes: mine.yaml}}]\n"
    )
    with pytest.raises(ConfigError, match=r"m\.yaml: grid\.classes: rows 'a' and 'b' have different ones"):
        load_matrix(str(tmp_path / "m.yaml"))
