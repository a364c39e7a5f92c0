import re

import numpy as np
import pandas as pd
import pytest
from support.fake_run import HOSTILE

from semgrid_eval.files import read_json
from semgrid_eval.report.claims.paper import paper_table
from semgrid_eval.report.estimates.bootstrap import COLUMNS, score_rows
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.write import latex_table, markdown_table


@pytest.fixture(scope="module")
def scores(run):
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=5)


def test_markdown_has_a_line_for_each_row(scores):
    lines = markdown_table(scores).splitlines()
    assert len(lines) == 2 + len(scores)
    assert len({line.count("|") for line in lines}) == 1
    assert f"{scores['ED-DC'].mean['vehicles']:.3f}" in next(line for line in lines if "ED-DC" in line)


def test_markdown_and_latex_escape_names(scores):
    odd = {"a|b_c & 5%\n$x$": scores["BL-DC"]}
    assert r"| a\|b\_c \& 5% \$x\$ |" in markdown_table(odd)
    assert r"a\textbar{}b\_c \& 5\% \$x\$ &" in latex_table(odd)
    assert latex_table(odd).splitlines()[-1] == r"\end{tabular}"


@pytest.mark.parametrize("name", [*HOSTILE, "[2pt] first", "* star", "\x1b[0m", "&lt;", "~~gone~~", "\u9053\u8def"])
def test_a_name_stays_one_cell_of_one_line(scores, name):
    tables = markdown_table({name: scores["BL-DC"]}), latex_table({name: scores["BL-DC"]})
    plain = markdown_table({"x": scores["BL-DC"]}), latex_table({"x": scores["BL-DC"]})
    assert [table.count("\n") for table in tables] == [table.count("\n") for table in plain]
    markdown, latex = (table.splitlines()[at] for table, at in zip(tables, (2, 4), strict=True))
    assert re.sub(r"\\.", "", markdown).count("|") == plain[0].splitlines()[2].count("|")
    left = re.sub(r"\\(?:text\w+\{\}|.)|\{\[\}|\{\*\}", "", latex.split(" & ")[0])
    assert not set(left) & set('&%$#_{}~^\\<>|"[*')


def test_the_summary_has_every_row_and_score(page, scores):
    table = pd.read_csv(page.parent / "summary.csv")
    assert len(table) == len(scores) * len(COLUMNS)
    known = table[np.isfinite(table.low)]
    assert (known.low <= known.high).all()


def test_the_record_for_machines_has_scores_differences_and_failures(page):
    record = read_json(page.parent / "report.json")
    assert record["rows"]["ED-DC"]["reference"] == "BL-DC"
    assert set(record["rows"]["ED-DC"]["differences"]) == set(COLUMNS)
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


def test_findings_and_regions_are_there_for_machines(page):
    record = read_json(page.parent / "report.json")
    finding = next(each for each in record["findings"] if each["name"] == "moving-BL-DC")
    (check,) = finding["checks"]
    ours = record["regions"]["moving"]["ED-DC"]["differences"]["vehicles"]
    assert {"value": check["difference"], "low": check["low"], "high": check["high"]} == ours
    assert next(each for each in record["findings"] if each["verdict"] == "not run")["checks"][0]["low"] is None
    table = pd.read_csv(page.parent / "regions.csv")
    line = table[(table.region == "moving") & (table.row == "ED-DC") & (table.score == "vehicles")]
    assert line.difference.item() == pytest.approx(ours["value"], abs=1e-6)


def test_the_papers_table_is_complete():
    table = paper_table()
    assert len(table) == 18
    assert table["ED-DC"]["car"] == 0.61
    assert table["BL-DC"]["vehicles"] == pytest.approx((0.52 + 0.55) / 2)
