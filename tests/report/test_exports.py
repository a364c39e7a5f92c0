import numpy as np
import pandas as pd
import pytest

from semgrid_eval.files import read_json
from semgrid_eval.report.estimates import COLUMNS, score_rows
from semgrid_eval.report.exports import latex_table, markdown_table
from semgrid_eval.report.paper import paper_table
from semgrid_eval.report.reading import load_runs


@pytest.fixture(scope="module")
def scores(run):
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=5)


def test_markdown_has_a_line_for_each_row(scores):
    lines = markdown_table(scores).splitlines()
    assert len(lines) == 2 + len(scores)
    assert len({line.count("|") for line in lines}) == 1
    assert f"{scores['ED-DC'].mean['vehicles']:.3f}" in next(line for line in lines if "ED-DC" in line)


def test_markdown_and_latex_escape_names(scores):
    odd = {"a|b_c & 5%\n$": scores["BL-DC"]}
    assert "| a\\|b\\_c & 5% $ |" in markdown_table(odd)
    assert r"a|b\_c \& 5\%" in latex_table(odd)
    assert latex_table(odd).splitlines()[-1] == r"\end{tabular}"


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
