from dataclasses import replace

from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import changed_settings, changed_targets, settings_but, settings_of


def test_settings_are_compared_key_by_key():
    before = {"settings.depth": 3, "settings.features": 64, "translate": True, "sensors": ["front"]}
    after = {"settings.depth": 4, "settings.features": 64, "translate": False, "sensors": ["a", "b"], "clip": None}
    assert list(changed_settings(before, after).values()) == [
        "settings.depth 3 to 4",
        "translate true to false",
        "sensors front to a, b",
        "clip not set to none",
    ]
    assert changed_settings(before, before) == {}


def test_the_settings_that_decide_the_targets_are_told_apart():
    before = {"grid.spec.cell_m": 0.5, "settings.depth": 3, "mask_mode": "exclude", "validation_split": "val"}
    after = {"grid.spec.cell_m": 0.25, "settings.depth": 4, "mask_mode": "off", "validation_split": "val"}
    assert changed_targets(before, after) == ["grid.spec.cell_m 0.5 to 0.25", "mask_mode exclude to off"]


def test_what_is_held_out_and_of_which_split_decides_the_targets():
    before = {"hold_out": [], "train_split": "train", "translate": True}
    after = {"hold_out": ["town03"], "train_split": "extra", "translate": False}
    assert changed_targets(before, after) == ["hold_out none to town03", "train_split train to extra"]


def test_rows_are_alike_but_for_a_setting(run):
    rows = {row.name: row for row in load_runs([run])[0].rows}
    assert settings_but(rows["BL-DC"]) != settings_but(rows["BL-NT"])
    assert settings_but(rows["BL-DC"], "translate") == settings_but(rows["BL-NT"], "translate")
    assert settings_but(rows["BL-DC"], "translate") != settings_but(rows["BL-Fuse"], "translate")


def test_sensors_that_a_row_does_not_use_are_no_setting_of_it(run):
    row = load_runs([run])[0].rows[0]
    assert row.record.facts.sensors == ("front",)
    sensors = {name: {"top_px": 7} for name in ("front", "rear", "side")}
    config = {"grid": {"sensors": sensors, "target": ["rear"], "morphology": "off"}}
    record = row.results[0].record.model_copy(update={"config": config})
    found = settings_of(replace(row, results=(replace(row.results[0], record=record),)))
    assert set(found) == {"grid.sensors.front.top_px", "grid.sensors.rear.top_px", "grid.target", "grid.morphology"}
