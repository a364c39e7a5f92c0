"""The matrices that come with the package."""

import csv
from importlib import resources

import pytest

from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.registry import find_model
from semgrid_eval.models.residual import ResidualSettings
from semgrid_eval.presets import preset_names
from semgrid_eval.runs.matrix import load_matrix

SCALED = ("reference", "architecture-cpu", "sensitivity", "updates-cpu")
TOLD = ("ceiling", "ceiling-SL5", "ceiling-PH1", "ceiling-PH2", "ceiling-PH3", "fresh-errors", "true-motion")


def test_paper_has_the_rows_of_table_a1_in_its_order():
    with (resources.files("semgrid_eval.report") / "data" / "table_a1.csv").open() as stream:
        published = [line["experiment"] for line in csv.DictReader(stream)]
    rows = load_matrix("paper").rows
    assert [row.name for row in rows[: len(published)]] == published
    assert {row.model for row in rows[len(published) :]} == {"residual", "residual-flow"}


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
    names = ("residual", "residual-flow")
    residual = [find_model(row.model).parse_settings(row.settings).training for row in scaled if row.model in names]
    assert set(residual) == {ResidualSettings().training}


def test_real_trains_as_paper_cpu_and_scores_windows_that_fit_ten_frames():
    scaled = {row.name: row for row in load_matrix("paper-cpu").rows}
    rows = load_matrix("real").rows
    assert {row.name for row in rows} == set(scaled) - {
        *("BL-PH2", "ED-PH2", "BL-PH3", "ED-PH3", "ED-SL4", "ED-SL5", "BL-Fuse-SL5", *TOLD),
        *("RN-PH2", "RN-PH3", "RN-any-PH2", "RN-any-PH3", "RN-SL5", "RN-Flow-SL5"),
    }
    for row in rows:
        alike = {"validation_window": None, "second_target": "expected"}
        assert row.model_copy(update=alike) == scaled[row.name]
        assert row.scored_window.reach_frames <= 9
        assert row.scored_window.step_frames == 3
        assert row.scored_window.horizon_steps == row.window.horizon_steps


def test_presets_for_two_cores_share_the_training_of_reference():
    rows = {f"{name} {row.name}": row for name in SCALED for row in load_matrix(name).rows}
    left_out = {"name", "second_target"}
    shared = rows["reference ED-DC"].model_dump(exclude=left_out)
    assert rows["updates-cpu ED-DC-75"].model_dump(exclude=left_out) == shared
    assert rows["architecture-cpu ED-d3-f16"].model_dump(exclude=left_out) == shared
    assert rows["sensitivity ED-default"].model_dump(exclude=left_out) == shared


def test_longer_training_differs_from_paper_cpu_in_features_and_updates_alone():
    shared = next(row for row in load_matrix("paper-cpu").rows if row.name == "ED-DC")
    for row in load_matrix("updates-cpu").rows:
        if row.model == "ed":
            updates = shared.settings["training"]["updates_per_epoch"]
            training = row.settings["training"] | {"updates_per_epoch": updates}
            assert row.settings | {"training": training} == shared.settings | {"features": 16}


def test_rows_counted_from_the_bottom_turn_the_splits_upside_down():
    rows = {row.name: row for row in load_matrix("sensitivity").rows}
    down, up = rows["BL-Sp2"].grid.sensors, rows["BL-Sp2-rows-up"].grid.sensors
    for end, other in (("upper", "lower"), ("lower", "upper")):
        top, bottom, left, right = down[f"split2_{other}"].crop_px
        assert up[f"split2_{end}"].crop_px == (256 - bottom, 256 - top, left, right)
    assert up["full"] == down["full"]
