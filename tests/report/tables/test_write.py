import numpy as np
import pandas as pd
import pytest
from support.scoring import score_rows

from semgrid_eval.files import read_json
from semgrid_eval.report.claims.claims import paper_table
from semgrid_eval.report.page.write import write_report
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU


@pytest.fixture(scope="module")
def scores(run):
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=5)


def test_the_summary_has_every_row_and_score(page, scores):
    table = pd.read_csv(page.parent / "summary.csv")
    assert len(table[(table.metric == "iou") & (table.division == "all")]) == len(scores) * len(IOU.labels)
    known = table[np.isfinite(table.low)]
    assert (known.low <= known.high).all()


def test_every_table_of_the_page_is_there_in_every_format(page):
    text = page.read_text()
    names = {path.stem for path in (page.parent / "tables").iterdir()}
    assert {"categories", "differences", "classes", "actors", "distance-differences", "costs"} <= names
    for name in names:
        assert f'id="table-{name}"' in text
        assert {path.suffix for path in (page.parent / "tables").glob(f"{name}.*")} == {".csv", ".json", ".md", ".tex"}
    assert (page.parent / "summary.md").read_text() == (page.parent / "tables" / "categories.md").read_text()


def test_the_record_for_machines_has_scores_differences_and_failures(page):
    record = read_json(page.parent / "report.json")
    assert record["rows"]["ED-DC"]["reference"] == "BL-DC"
    assert set(record["rows"]["ED-DC"]["differences"]) == set(IOU.labels)
    assert [failure["name"] for failure in record["failures"]] == ["ED-NT", "logs/town_broken.mcap"]
    assert record["runs"][0]["record"]["logs"][0]["digest"]


def test_every_result_is_there_for_machines_with_its_cost_and_windows(page):
    rows = read_json(page.parent / "report.json")["rows"]
    results = rows["ED-DC"]["results"]
    assert [result["seed"] for result in results] == [0, 1, 2]
    assert results[0]["train_seconds"] == 80.0
    assert results[0]["config"]["model"] == "ed"
    windows = pd.read_csv(page.parent / "windows.csv").set_index("window_set")
    assert len(windows.loc[results[0]["windows_id"]]) == results[0]["window_count"] == 16
    assert rows["ED-NT"]["failure"] == "the loss became not a number in epoch 3"


def test_the_times_of_inputs_stand_beside_each_window(page):
    windows = pd.read_csv(page.parent / "windows.csv", dtype={"input_stamps_ns": str})
    older, newest = np.array([text.split() for text in windows.input_stamps_ns], np.int64).T
    assert (older < newest).all()
    assert (newest < windows.target_stamp_ns).all()


def test_training_histories_are_one_table(page):
    table = pd.read_csv(page.parent / "training.csv")
    assert table.groupby(["row", "seed"]).size().to_dict() == {
        **{("ED-DC", seed): 6 for seed in range(3)},
        **{("ED-Sp2", seed): 6 for seed in range(2)},
    }
    assert {"epoch", "loss", "validation_loss"} <= set(table.columns)


def test_what_a_clock_measured_stands_apart_from_what_comes_out_the_same_again(page):
    timings = pd.read_csv(page.parent / "timings.csv")
    assert timings.groupby(["row", "of"]).size()["ED-DC"].to_dict() == {"epoch": 18, "prediction": 3, "training": 3}
    assert timings[(timings.row == "ED-DC") & (timings.of == "training")].seconds.tolist() == [80.0, 81.0, 82.0]
    assert timings[timings.of == "prediction"].seconds.eq(1.25).all()
    for path in page.parent.glob("*.csv"):
        if path.name not in ("timings.csv", "streams.csv"):  # what streams say is drawn, or recorded
            columns = pd.read_csv(path).columns
            assert not [name for name in columns if "seconds" in name or name.endswith("_ms")], path.name


def test_findings_and_regions_are_there_for_machines(page):
    record = read_json(page.parent / "report.json")
    finding = next(each for each in record["findings"] if each["name"] == "moving-BL-DC")
    (check,) = finding["checks"]
    ours = record["metrics"]["iou"]["actors"]["moving"]["ED-DC"]["differences"]["vehicles"]
    assert {"value": check["difference"], "low": check["low"], "high": check["high"]} == ours
    assert next(each for each in record["findings"] if each["verdict"] == "not run")["checks"][0]["low"] is None
    table = pd.read_csv(page.parent / "summary.csv").set_index(["metric", "division", "region", "row", "column"])
    line = table.loc[("iou", "actors", "moving", "ED-DC", "vehicles")]
    assert line.difference == pytest.approx(ours["value"], abs=1e-6)


@pytest.mark.slow
def test_the_level_of_resampling_is_told_with_its_reason(run, tmp_path):
    grouped = write_report(run, tmp_path / "report", resample="groups")
    interval = read_json(grouped.parent / "report.json")["interval"]
    assert interval["over"] == "groups"
    assert "may depend on each other" in interval["why"]
    assert interval["why"] in grouped.read_text()


def test_the_papers_table_is_complete():
    table = paper_table()
    assert len(table) == 18
    assert table["ED-DC"]["car"] == 0.61
    assert table["BL-DC"]["vehicles"] == pytest.approx((0.52 + 0.55) / 2)
