"""Every format writes the same table, whatever names it has."""

import io
import json
import re

import pandas as pd
import pytest
from support.fake_run import HOSTILE
from support.scoring import score_rows

from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.formats.csv import as_csv, frame_csv
from semgrid_eval.report.tables.formats.json import as_json
from semgrid_eval.report.tables.formats.latex import as_latex
from semgrid_eval.report.tables.formats.markdown import as_markdown
from semgrid_eval.report.tables.table import Cell, Line, Table
from semgrid_eval.report.tables.values import value_table

SHOWN = ("vehicles", "small_dynamic")


@pytest.fixture(scope="module")
def table(run):
    scores = score_rows(load_runs([run])[0].rows, 0, draws=20)
    return value_table("name", "Caption", scores, SHOWN, on_cityscapes=[run])


def named(*headers):
    cell = Cell("0.500", 0.5, "0.400\N{EN DASH}0.600", interval=(0.4, 0.6))
    return Table("name", "", "Row", (("Vehicles", "9 cells"),), tuple((Line(name, (cell,)),) for name in headers))


def test_markdown_has_a_line_for_each_line_of_the_table(table):
    lines = as_markdown(table).splitlines()
    assert len(lines) == 2 + sum(len(body) for body in table.bodies)
    assert len({line.count("|") for line in lines}) == 1
    best = next(cell for body in table.bodies for cell in body[0].cells if cell.tone == "best")
    assert f"**{best.text}** ({best.note})" in as_markdown(table)


def test_csv_has_numbers_with_their_intervals(table):
    found = pd.read_csv(io.StringIO(as_csv(table))).set_index("Row")
    line = next(body[0] for body in table.bodies if body[0].header == "ED-DC")
    assert list(found.columns[:3]) == ["Vehicles", "Vehicles low", "Vehicles high"]
    assert found.loc["ED-DC", "Vehicles"] == pytest.approx(line.cells[0].sort, abs=1e-6)
    assert found.loc["ED-DC", "Vehicles low"] == pytest.approx(line.cells[0].interval[0], abs=1e-6)
    assert "ED-DC: paper" in found.index


def test_json_has_all_that_a_cell_says(table):
    found = json.loads(as_json(table))
    assert (found["name"], found["caption"]) == ("name", "Caption")
    cell = next(line["cells"][0] for line in found["lines"] if line["header"] == "ED-DC")
    shown = next(body[0].cells[0] for body in table.bodies if body[0].header == "ED-DC")
    assert cell == {
        "text": shown.text,
        "value": shown.sort,
        "verdict": shown.tone,
        "evidence": shown.title,
        "low": shown.interval[0],
        "high": shown.interval[1],
    }


def test_markdown_and_latex_escape_names():
    odd = named("a|b_c & 5%\n$x$")
    assert r"| a\|b\_c \& 5% \$x\$ |" in as_markdown(odd)
    assert r"a\textbar{}b\_c \& 5\% \$x\$ &" in as_latex(odd)
    assert as_latex(odd).splitlines()[-1] == r"\end{tabular}"


@pytest.mark.parametrize("name", [*HOSTILE, "[2pt] first", "* star", "\x1b[0m", "&lt;", "~~gone~~", "\u9053\u8def"])
def test_a_name_stays_one_cell_of_one_line(name):
    tables = as_markdown(named(name)), as_latex(named(name))
    plain = as_markdown(named("x")), as_latex(named("x"))
    assert [table.count("\n") for table in tables] == [table.count("\n") for table in plain]
    markdown, latex = (table.splitlines()[at] for table, at in zip(tables, (2, 4), strict=True))
    assert re.sub(r"\\.", "", markdown).count("|") == plain[0].splitlines()[2].count("|")
    left = re.sub(r"\\(?:text\w+\{\}|.)|\{\[\}|\{\*\}", "", latex.split(" & ")[0])
    assert not set(left) & set('&%$#_{}~^\\<>|"[*')
    assert pd.read_csv(io.StringIO(as_csv(named(name)))).shape == (1, 4)


def test_absent_values_are_dashes_in_text_and_nothing_elsewhere():
    absent = Table("", "", "Row", (("Car", ""),), ((Line("a", (Cell("\N{EN DASH}"),)),),))
    assert "a & -- " in as_latex(absent)
    assert as_csv(absent) == "Row,Car\na,\n"
    assert json.loads(as_json(absent))["lines"][0]["cells"][0]["value"] is None


def test_columns_of_several_regions_are_told_apart():
    columns = (("Car", "moving, 2,164 cells"), ("Car", "standing, 7 cells"))
    table = Table("", "", "Row", columns, ((Line("a", (Cell("1", 1.0), Cell("2", 2.0))),),))
    assert as_csv(table).splitlines()[0] == "Row,Car (moving),Car (standing)"


@pytest.mark.parametrize("name", ["=1+2", "+1 row", "-row", "@sum", "\t=1", "\r=1", "=HYPERLINK(1)"])
def test_no_spreadsheet_takes_a_name_for_a_formula(name):
    (header, line) = as_csv(named(name)).splitlines()
    assert header == "Row,Vehicles,Vehicles low,Vehicles high"
    assert line.startswith("'")
    column = Table("", "", "Row", ((name, ""),), ((Line("a", (Cell("1", 1.0),)),),))
    assert as_csv(column).splitlines()[0].startswith("Row,'")


def test_numbers_and_plain_words_are_written_as_they_are():
    frame = pd.DataFrame({"a": ["-0.5", "x=1", "2"], "b": [-1.0, 0.25, None], "c": [1, 2, 3]})
    assert frame_csv(frame) == "a,b,c\n-0.5,-1.000000,1\nx=1,0.250000,2\n2,,3\n"


def test_what_would_move_a_cursor_is_escaped_in_every_format():
    odd = named("\x1b[31m\u202ered")
    assert "\\x1b[31m\\u202ered" in as_csv(odd)
    assert "\\\\x1b\\[31m\\\\u202ered" in as_markdown(odd)
    for text in (as_csv(odd), as_markdown(odd), as_latex(odd), as_json(odd)):
        assert "\x1b" not in text
        assert "\u202e" not in text
