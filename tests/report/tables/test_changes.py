from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.scores import changes_table
from semgrid_eval.report.tables.targets import fusion_sentence, not_compared_sentence, not_compared_table

MODELS = ("BL", "ED")


def _with_config(row, name, **config):
    results = tuple(replace(r, record=r.record.model_copy(update={"config": config})) for r in row.results)
    return replace(row, name=name, record=row.record.model_copy(update={"name": name}), results=results)


def test_each_row_is_set_against_the_closest_one_of_its_model_above_it(run):
    scores = score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=20)
    table = changes_table(scores)
    assert [body[0].header for body in table.bodies] == [
        "BL-NT \N{MINUS SIGN} BL-DC",
        "ED-Sp2 \N{MINUS SIGN} ED-DC",
    ]
    settings, mean, *_ = table.bodies[-1][0].cells
    assert settings.text == "sensors front to lower, upper"
    assert mean.sort == pytest.approx(scores["ED-Sp2"].mean["mean_known"] - scores["ED-DC"].mean["mean_known"])
    for words in ("16 windows", "2 results", "95% interval"):
        assert words in mean.title


@pytest.fixture(scope="module")
def finer(tmp_path_factory):
    """Scores of rows of which two have finer grids, so other targets."""
    rows = tuple(FakeRow(w, f, 0.1, int(f == "ED"), cell_m=m) for w, m in (("DC", 0.8), ("fine", 0.4)) for f in MODELS)
    run = make_fake_run(
        tmp_path_factory.mktemp("runs") / "run", rows=(*rows, FakeRow("Fuse", "BL", cell_m=0.8)), recordings=2
    )
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=2)


def test_scores_on_other_targets_stand_side_by_side_and_are_not_subtracted(finer):
    (line,) = next(body for body in changes_table(finer).bodies if body[0].header.startswith("ED"))
    assert line.header == "ED-fine beside ED-DC"
    settings, mean, *_ = line.cells
    assert settings.text == "grid.cell_m 0.8 to 0.4"
    assert mean.text == f"{finer['ED-fine'].mean['mean_known']:.3f}, {finer['ED-DC'].mean['mean_known']:.3f}"
    assert (mean.note, mean.sort) == ("other targets", None)


def test_the_page_says_which_rows_are_not_compared_and_why(finer):
    table = not_compared_table(finer)
    assert "BL-DC and the rows that share its targets" in table.caption
    ((line,),) = table.bodies
    assert line.header == "BL-fine, ED-fine"
    assert line.cells[0].text == "grid.cell_m 0.8 to 0.4 (against BL-DC)"
    assert (line.cells[1].text, line.cells[1].note) == ("4", "4 shared")
    said = not_compared_sentence([entry.row for entry in finer.values()])
    assert said.endswith("since their targets are others: BL-fine, ED-fine (grid.cell_m 0.8 to 0.4).")
    assert line.cells[2].text == "\N{EN DASH}", "the size of its cells is not told"


def test_the_known_area_of_other_targets_is_set_against_the_main_ones(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("Fuse", "BL"), FakeRow("fine", "BL", cell_m=0.4))
    folder = make_fake_run(tmp_path / "run", rows=rows, recordings=2)
    rows = [
        _with_config(row, row.name, grid=GridConfig(spec=GridSpec(cell_m=cell_m)).model_dump(mode="json"))
        for row, cell_m in zip(load_runs([folder])[0].rows, (0.8, 0.8, 0.4), strict=True)
    ]
    ((line,),) = not_compared_table(score_rows(rows, np.random.default_rng(0), draws=2)).bodies
    known = [int(row.results[0].counts[:, 1:].sum()) for row in rows]
    assert (line.header, line.cells[2].text) == ("BL-fine", f"{known[2] / 4 * 0.16:,.0f} m\N{SUPERSCRIPT TWO}")
    assert line.cells[2].note == f"{known[2] / known[0] / 4:.1%} of BL-DC's"


def test_the_page_says_where_targets_are_of_several_sensors(run):
    row, *_ = load_runs([run])[0].rows

    def said(*target):
        grid = GridConfig(target=target).model_dump(mode="json")
        return fusion_sentence([_with_config(row, "one", grid=grid)])

    sensors = "what split1_upper, split1_lower and split2_upper have measured together by the times of split1_upper"
    assert sensors in said("split1_upper", "split1_lower", "split2_upper")
    assert said("full") == fusion_sentence([row]) == ""


def test_logs_that_differ_are_a_reason_not_to_compare(tmp_path):
    folders = [
        make_fake_run(tmp_path / name, rows=(FakeRow("DC", "BL"),), recordings=count, windows=1)
        for name, count in (("more", 3), ("fewer", 2))
    ]
    rows = [row for run in load_runs(folders) for row in run.rows]
    ((line,),) = not_compared_table(score_rows(rows, np.random.default_rng(0), draws=2)).bodies
    assert line.header == "BL-DC (fewer)"
    assert line.cells[0].text == "the logs or their frames (against BL-DC (more))"
    assert (line.cells[1].text, line.cells[1].note) == ("2", "2 shared")


def test_where_all_targets_are_the_same_nothing_is_said(run):
    scores = score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=2)
    assert not_compared_table(scores) is None
    assert not_compared_sentence([entry.row for entry in scores.values()]) == ""
    assert not_compared_table({}) is None


def test_a_row_is_set_against_the_one_with_the_fewest_other_settings(run):
    row = load_runs([run])[0].rows[0]
    settings = {
        "default": {"y": "down", "overlay": "upper", "sensors": 1},
        "two": {"y": "down", "overlay": "upper", "sensors": 2},
        "lower": {"y": "down", "overlay": "lower", "sensors": 2},
        "again": {"y": "down", "overlay": "upper", "sensors": 1},  # the same as the first: nothing to show
    }
    rows = [_with_config(row, name, **config) for name, config in settings.items()]
    table = changes_table(score_rows(rows, np.random.default_rng(0), draws=2))
    assert [body[0].header for body in table.bodies] == ["two \N{MINUS SIGN} default", "lower \N{MINUS SIGN} two"]
    assert [body[0].cells[0].text for body in table.bodies] == ["sensors 1 to 2", "overlay upper to lower"]


def test_rows_that_change_nothing_give_no_table(run):
    row = load_runs([run])[0].rows[0]
    twins = [row, replace(row, name="twin")]
    assert changes_table(score_rows(twins, np.random.default_rng(0), draws=2)) is None
