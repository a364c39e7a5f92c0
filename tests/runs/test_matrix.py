import csv
import importlib.metadata
import os
from importlib import resources
from pathlib import Path

import pytest
import yaml
from support.own_classes import FILE

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.registry import ENTRY_POINT_GROUP
from semgrid_eval.models.residual import ResidualSettings
from semgrid_eval.runs.matrix import load_matrix, preset_names

SCALED = ("paper-cpu", "architecture-cpu", "sensitivity")


def load(tmp_path, content):
    path = tmp_path / "m.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return load_matrix(str(path))


def test_paper_has_the_rows_of_table_a1_in_its_order():
    with (resources.files("semgrid_eval.report") / "data" / "table_a1.csv").open() as stream:
        published = [line["experiment"] for line in csv.DictReader(stream)]
    rows = load_matrix("paper").rows
    assert [row.name for row in rows[: len(published)]] == published
    assert {row.model for row in rows[len(published) :]} == {"residual"}


def test_one_training_answers_every_lead_of_the_paper():
    rows = [row for row in load_matrix("paper").rows if row.train_leads]
    assert [row.name for row in rows] == ["RN-any-DC", "RN-any-PH1", "RN-any-PH2", "RN-any-PH3"]
    assert [row.window.horizon_steps for row in rows] == [1, 2, 3, 4]
    assert rows[0].train_leads == (1, 20)
    assert {row.window.lead_frames for row in rows} <= set(rows[0].leads_frames)


def test_paper_trains_as_the_supplement_says():
    rows = {row.name: row for row in load_matrix("paper").rows}
    dc = rows["ED-DC"]
    assert (dc.settings["depth"], dc.settings["features"], dc.window.inputs, dc.window.step_frames) == (3, 64, 2, 5)
    training = dc.settings["training"]
    assert (training["epochs"], training["updates_per_epoch"], training["batch"], dc.repeats) == (40, 185, 32, 20)
    assert [rows[f"ED-PH{k}"].window.horizon_steps for k in (1, 2, 3)] == [2, 3, 4]
    assert {row.window.target_frame for row in rows.values()} == {25}
    assert not rows["ED-NT"].translate
    assert not rows["BL-NT"].translate
    assert rows["ED-SL2"].identity() == dc.identity()


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_loads(name):
    assert load_matrix(name).rows


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


@pytest.mark.slow
def test_models_of_ones_own_are_rows_with_the_matrix_s_defaults(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lib").mkdir()
    for file in ("mine.py", "lib/mine.py"):
        Path(file).touch()
    write(tmp_path, mine={"defaults": {"mask_mode": "off"}, "rows": [{"name": "a", "model": "newest"}]})
    rows = load_matrix(str(tmp_path / "mine.yaml"), models=["lib/mine.py:Mine", "mine.py:Other"]).rows
    assert [(row.name, row.model, row.facts.family, row.mask_mode) for row in rows[1:]] == [
        ("Mine", "lib/mine.py:Mine", "Mine", "off"),
        ("Other", "mine.py:Other", "Other", "off"),
    ]
    with pytest.raises(ConfigError, match="'de' is not one of"):
        load_matrix("smoke", models=["de"])


@pytest.mark.slow
def test_an_installed_model_is_a_row_and_is_looked_for_only_where_one_is_asked_for(tmp_path, monkeypatch):
    looked_for = []

    def entry_points(*, group):
        looked_for.append(group)
        return importlib.metadata.EntryPoints([importlib.metadata.EntryPoint("mine", "package:Mine", group)])

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    (tmp_path / "mine.py").touch()
    load_matrix("paper", models=[f"{tmp_path}/mine.py:Mine"])
    assert looked_for == []
    assert load(tmp_path, {"rows": [{"name": "a", "model": "mine"}]}).rows[0].model == "mine"
    assert set(looked_for) == {ENTRY_POINT_GROUP}
    with pytest.raises(ConfigError, match=r"'yours' is not one of ed, .*, mine, path\.py:Class"):
        load(tmp_path, {"rows": [{"name": "a", "model": "yours"}]})


def test_a_name_that_is_neither_file_nor_preset_lists_the_presets():
    with pytest.raises(ConfigError, match=r"papre: is neither a file nor a preset \(.*\); did you mean paper\?$"):
        load_matrix("papre")


def write(folder, **files):
    for name, content in files.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))


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


TOLD = ("ceiling", "ceiling-PH1", "ceiling-PH2", "ceiling-PH3", "fresh-errors", "true-motion")


def test_paper_cpu_has_the_rows_of_paper_the_stronger_baselines_and_what_is_possible():
    paper, scaled = (load_matrix(name).rows for name in ("paper", "paper-cpu"))
    assert [row.name for row in scaled] == [row.name for row in paper] + [
        "BL-Fuse",
        "BL-Fuse-SL5",
        "BL-Table",
        "BL-Flow",
        *TOLD,
    ]
    assert tuple(row.name for row in scaled if row.facts.uses_truth) == TOLD
    scaling = {"settings", "repeats", "second_target"}
    for full, small in zip(paper, scaled, strict=False):
        assert full.model_dump(exclude=scaling) == small.model_dump(exclude=scaling)
    trained = [EncoderDecoderSettings.model_validate(row.settings) for row in scaled if row.model == "ed"]
    assert {(settings.features, settings.training.batch) for settings in trained} == {(32, 8)}
    assert {settings.training.updates_until(settings.training.epochs) for settings in trained} == {2200}
    assert {row.repeats for row in scaled} == {1}
    residual = [parse_config(ResidualSettings, row.settings).training for row in scaled if row.model == "residual"]
    assert set(residual) == {ResidualSettings().training}


def test_real_trains_as_paper_cpu_and_scores_windows_that_fit_ten_frames():
    scaled = {row.name: row for row in load_matrix("paper-cpu").rows}
    rows = load_matrix("real").rows
    assert {row.name for row in rows} == set(scaled) - {
        *("BL-PH2", "ED-PH2", "BL-PH3", "ED-PH3", "ED-SL4", "ED-SL5", "BL-Fuse-SL5", *TOLD),
        *("RN-PH2", "RN-PH3", "RN-any-PH2", "RN-any-PH3", "RN-SL5"),
    }
    for row in rows:
        alike = {"validation_window": None, "second_target": "expected"}
        assert row.model_copy(update=alike) == scaled[row.name]
        assert row.scored_window.reach_frames <= 9
        assert row.scored_window.step_frames == 3
        assert row.scored_window.horizon_steps == row.window.horizon_steps


def test_cpu_presets_share_the_training_of_paper_cpu():
    rows = {f"{name} {row.name}": row for name in SCALED for row in load_matrix(name).rows}
    left_out = {"name", "second_target"}
    shared = rows["paper-cpu ED-DC"].model_dump(exclude=left_out)
    assert rows["architecture-cpu ED-d3-f32"].model_dump(exclude=left_out) == shared
    assert rows["sensitivity ED-default"].model_dump(exclude=left_out) == shared


def test_longer_training_differs_from_paper_cpu_in_features_and_updates_alone():
    shared = next(row for row in load_matrix("paper-cpu").rows if row.name == "ED-DC")
    for row in load_matrix("updates-cpu").rows:
        if row.model == "ed":
            updates = shared.settings["training"]["updates_per_epoch"]
            training = row.settings["training"] | {"updates_per_epoch": updates}
            assert row.settings | {"training": training} == shared.settings | {"features": 16}


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


def test_settings_of_a_model_lie_under_those_of_its_rows_alone(tmp_path):
    row = {"name": "{model}-{settings.depth}", "axes": {"zip": {"model": ["ed", "ed"], "settings.depth": [2, 4]}}}
    rows = [row, {"name": "f", "model": "ed", "settings": {"features": 8}}, {"name": "n", "model": "newest"}]
    matrix = load(tmp_path, {"models": {"ed": {"features": 4, "depth": 5}}, "rows": rows})
    told = {row.name: (row.settings.get("depth"), row.settings.get("features")) for row in matrix.rows}
    assert told == {"ed-2": (2, 4), "ed-4": (4, 4), "f": (5, 8), "n": (None, None)}


def test_settings_of_what_is_no_model_are_an_error(tmp_path):
    with pytest.raises(ConfigError, match=r"m\.yaml: models: 'edd' is not one of ed, .*did you mean ed\?"):
        load(tmp_path, {"models": {"edd": {}}, "rows": [{"name": "a", "model": "newest"}]})


OWN = """
from pydantic import field_validator
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.network import Network, NetworkSettings

class Own(Network):
    words = "an own network"

    class Settings(NetworkSettings):
        width: int = 3

        @field_validator("width")
        @classmethod
        def _looked_up(cls, width):
            return {3: 3, 4: 4, 8: 8, 999: 999}[width]

    @classmethod
    def check(cls, settings, given):
        if settings.width > given.columns:
            raise ConfigError("is too wide", field="settings.width")
"""


@pytest.mark.slow
def test_settings_of_ones_own_network_are_axes_and_checked_where_its_code_can_be_loaded(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    model = f"{tmp_path}/own.py:Own"
    row = {"name": "w{settings.width}", "model": model, "repeats": 2, "axes": {"grid": {"settings.width": [4, 8]}}}
    rows = load(tmp_path, {"models": {model: {"training": {"epochs": 2}}}, "rows": [row]}).rows
    assert [(row.settings["width"], row.settings["training"]["epochs"]) for row in rows] == [(4, 2), (8, 2)]
    assert rows[0].settings["training"]["batch"] == 32
    assert rows[0].label.startswith("w4 (an own network, moved to the target's time")
    assert (rows[0].facts.family, rows[0].facts.learns, rows[0].facts.baseline) == ("Own", True, False)
    faults = (
        ({"widht": 4}, r"settings\.widht: unknown key"),
        ({"width": 999}, "width: is too wide"),
        ({"width": 5}, r"own\.py:Own: raised KeyError: 5$"),
    )
    for settings, message in faults:
        with pytest.raises(ConfigError, match=rf"m\.yaml: row 'a': .*{message}"):
            load(tmp_path, {"rows": [{"name": "a", "model": model, "settings": settings}]})
    (tmp_path / "own.py").write_text("def half(")
    row = load(tmp_path, {"rows": [{"name": "a", "model": model, "settings": {"widht": 4}}]}).rows[0]
    assert (row.settings, row.facts.family, row.facts.learns) == ({"widht": 4}, "Own", False)


def test_facts_are_what_the_model_says(tmp_path):
    rows = [{"name": name, "model": name} for name in ("ed", "newest", "table", "fuse", "flow")]
    facts = {row.name: row.facts for row in load(tmp_path, {"rows": rows}).rows}
    assert {name: (fact.family, fact.learns, fact.baseline) for name, fact in facts.items()} == {
        "ed": ("ED", True, False),
        "newest": ("BL", False, True),
        "table": ("BL", True, True),
        "fuse": ("BL", False, True),
        "flow": ("BL", False, True),
    }


def test_rows_counted_from_the_bottom_turn_the_splits_upside_down():
    rows = {row.name: row for row in load_matrix("sensitivity").rows}
    down, up = rows["BL-Sp2"].grid.sensors, rows["BL-Sp2-rows-up"].grid.sensors
    for end, other in (("upper", "lower"), ("lower", "upper")):
        top, bottom, left, right = down[f"split2_{other}"].crop_px
        assert up[f"split2_{end}"].crop_px == (256 - bottom, 256 - top, left, right)
    assert up["full"] == down["full"]


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
    assert rows[0].identity()["grid"]["classes"] == rows[0].grid.classes.model_dump(mode="json")


def test_rows_of_a_matrix_have_one_class_set(tmp_path):
    (tmp_path / "mine.yaml").write_text(FILE)
    (tmp_path / "m.yaml").write_text(
        "rows: [{name: a, model: newest}, {name: b, model: fuse, grid: {classes: mine.yaml}}]\n"
    )
    with pytest.raises(ConfigError, match=r"m\.yaml: grid\.classes: rows 'a' and 'b' have different ones"):
        load_matrix(str(tmp_path / "m.yaml"))
