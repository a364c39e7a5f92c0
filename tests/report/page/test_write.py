import filecmp
import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser

import pandas as pd
import pytest
from support.fake_run import HOSTILE, FakeRow, make_fake_run

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.files import read_json
from semgrid_eval.report.page.write import write_report
from semgrid_eval.scores.results import read_run, write_run

VOID = {"meta", "link", "img", "input", "br"}


class _Page(HTMLParser):
    """Collects what a test asks for and insists that every element is closed where it should be."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def _read(path):
    return _Page(path.read_text(encoding="utf-8"))


def _report_of(tmp_path, **kwargs):
    return write_report(make_fake_run(tmp_path / "run", recordings=2, windows=1, **kwargs))


def test_the_page_answers_in_order(page):
    titles = [a["id"] for a in _read(page).all("section")]
    assert titles == [
        *("summary", "rows", "examples", "scores", "ceiling", "findings", "where", "training"),
        *("failures", "provenance"),
    ]


def test_the_page_is_well_formed_and_accessible(page):
    found = _read(page)
    assert found.all("html") == [{"lang": "en"}]
    assert all(image["alt"] for image in found.all("img"))
    assert all(image["src"].startswith("data:image/") for image in found.all("img"))
    ids = [a["id"] for _, a in found.tags if "id" in a]
    assert len(ids) == len(set(ids))
    assert {a["href"][1:] for a in found.all("a")} <= set(ids)
    assert len(found.all("caption")) == len(found.all("table"))
    assert all(a.get("scope") in ("col", "row", "rowgroup") for a in found.all("th"))


def test_the_page_needs_no_network(page):
    text = re.sub(r'"data:[^"]*"', '""', page.read_text(encoding="utf-8"))
    assert not re.search(r"(src|href)=\"(?!#|\")", text)
    assert not re.search(r"@import|url\((?!#)|https?:", text)


def test_three_example_windows_and_their_traces_are_shown(page):
    found = _read(page)
    assert [a["class"] for a in found.all("article")].count("window") >= 3
    for words in ("Input 1 of 2", "Target", "BL-NT", "Certainty", "frame 20", "val/town_00"):
        assert words in found.text


def test_each_sensors_newest_input_is_shown(page):
    titles = [image["alt"] for image in _read(page).all("img")]
    for sensor in ("lower", "upper"):
        assert f"Input 2 of 2, {sensor}, aligned to the target" in titles


def test_a_windows_log_is_listed_under_the_same_name(page):
    found = _read(page)
    assert found.words.count("val/town_000.mcap") > 1


def test_findings_count_their_verdicts(page):
    found = _read(page)
    assert "9 can be tested here: 4 hold, 1 does not, 4 are undecided." in found.text
    assert "ED-DC is better than BL-Fuse on static classes and vehicles does not hold" in found.text
    assert "ED-DC is better than BL-DC on moving vehicles alone holds" in found.text
    assert "ED-NT falls behind ED-DC on small classes ED-NT" in found.text  # its row failed, so it stands as a need


def test_failures_and_provenance_are_told(page):
    text = _read(page).text
    for words in (
        "row ED-NT the loss became not a number in epoch 3",
        "log logs/town_broken.mcap the index is missing",
        "semgrid-eval run smoke --logs logs --out run",
        "5 min 12 s",
        "two shared cores",
    ):
        assert words in text


def test_the_tables_hold_the_numbers_of_the_long_form(page):
    scores = pd.read_csv(page.parent / "scores.csv")
    row = scores[(scores.row == "ED-DC") & (scores.division == "all") & (scores.column == "car")]
    assert f"{row.value.mean():.3f}" in _read(page).text


def test_files_beside_the_page_are_there(page):
    names = {str(path.relative_to(page.parent)) for path in page.parent.rglob("*") if path.is_file()}
    assert {"index.html", "scores.csv", "summary.csv", "calibration.csv", "summary.md", "summary.tex"} <= names
    for name in ("categories", "training"):
        assert {f"figures/{name}.png", f"figures/{name}.svg"} <= names


def test_every_figure_names_the_table_that_it_was_drawn_from(page):
    text = page.read_text(encoding="utf-8")
    sources = re.findall(r"Drawn from <code>(.*?)</code>; also as <code>(.*?)</code>", text)
    assert len(sources) >= 3
    for names in sources:
        for name in names:
            assert (page.parent / name).is_file()


def test_every_number_tells_what_stands_behind_it(page):
    cells = [a for a in _read(page).all("td") if "data-sort" in a]
    without = {a["data-sort"] for a in cells if not a.get("title")}
    assert len(cells) > 500
    assert len(without) < 40  # sizes and counts, which stand for themselves


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes_without_torch(run, page, tmp_path):
    code = """import sys
from pathlib import Path
from semgrid_eval.report.page.write import write_report
write_report(Path(sys.argv[1]), Path(sys.argv[2]))
assert 'torch' not in sys.modules and 'semgrid_eval.runs' not in sys.modules"""
    again = tmp_path / "again"
    environment = {**os.environ, "PYTHONHASHSEED": "4711"}
    subprocess.run([sys.executable, "-c", code, run, again], check=True, env=environment)
    names = [str(path.relative_to(again)) for path in again.rglob("*") if path.is_file()]
    assert filecmp.cmpfiles(page.parent, again, names, shallow=False) == (names, [], [])
    assert len(names) == sum(path.is_file() for path in page.parent.rglob("*"))


def test_a_folder_that_is_no_report_is_left_alone(run, tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="not a report"):
        write_report(run, tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_a_folder_without_a_run_is_named(tmp_path):
    with pytest.raises(ResultError, match=re.escape(str(tmp_path))):
        write_report(tmp_path)


def test_failed_rows_only(tmp_path):
    page = _report_of(tmp_path, rows=(FakeRow("DC", "ED", failure="out of memory"),))
    text = _read(page).text
    assert "No row has a score" in text
    assert "row ED-DC out of memory" in text
    assert pd.read_csv(page.parent / "scores.csv").empty
    assert read_json(page.parent / "report.json")["rows"]["ED-DC"]["scores"] == {}


@pytest.fixture(scope="module")
def lonely(tmp_path_factory):
    """The page of one row and one window, in the default place, where an older report lies."""
    run = make_fake_run(
        tmp_path_factory.mktemp("runs") / "run", rows=(FakeRow("DC", "BL"),), recordings=1, windows=1, truth=False
    )
    old = run / "report"
    (old / "notes").mkdir(parents=True)
    for name in ("index.html", "old.csv"):
        (old / name).touch()
    (old / "report.json").write_text(json.dumps({"files": ["old.csv"]}))
    (old / "notes" / "mine.txt").write_text("precious")
    return write_report(run)


def test_an_old_report_in_the_default_place_is_replaced_and_what_is_not_its_own_stays(lonely):
    assert lonely.parent.name == "report"
    assert (lonely.parent.parent / "run.json").is_file()
    assert not (lonely.parent / "old.csv").exists()
    assert (lonely.parent / "notes" / "mine.txt").read_text() == "precious"


def test_one_row_only(lonely):
    text = _read(lonely).text
    assert "BL-DC has the highest mean IoU of known classes" in text
    assert "no other row to compare with" in text
    assert "No row was trained" in text
    assert "This run lacks the rows to test any of the 61 claims" in text
    assert "No log here tells where the actors truly are" in text
    assert "actors" not in set(pd.read_csv(lonely.parent / "summary.csv").division)


def test_a_class_in_neither_target_nor_prediction_is_a_dash_and_empty(lonely):
    scores = pd.read_csv(lonely.parent / "scores.csv")
    classes = scores[(scores.metric == "iou") & (scores.division == "all")].set_index("column")
    absent = [name for name in CLASS_NAMES if pd.isna(classes.value[name])]
    assert absent
    assert (classes.cells[absent] == 0).all()
    assert "\N{EN DASH}" in _read(lonely).text
    assert read_json(lonely.parent / "report.json")["rows"]["BL-DC"]["scores"][absent[0]]["value"] is None


def test_a_tile_marks_a_difference_only_where_there_is_one(tmp_path):
    rows = FakeRow("DC", "BL"), FakeRow("DC", "ED")
    text = write_report(make_fake_run(tmp_path / "run", rows=rows, recordings=1, windows=1)).read_text(encoding="utf-8")
    tiles = text.partition('<ul class="tiles">')[2].partition("</ul>")[0].split("<li ")[1:]
    assert {("absent" in tile, 'class="at"' in tile) for tile in tiles} == {(True, False), (False, True)}


def test_zero_windows(tmp_path):
    page = write_report(make_fake_run(tmp_path / "run", recordings=0))
    text = _read(page).text
    assert "No row has a score" in text
    assert "row BL-DC it has no window to score" in text


def test_a_damaged_result_fails_its_row_and_the_rest_goes_on(troubled):
    text = _read(troubled).text
    assert "row BL-Fuse" in text
    assert "/sums.npz" in text
    assert "has the highest mean IoU of known classes" in text


def test_names_are_shown_as_text(troubled):
    found = _read(troubled)
    assert len(found.all("script")) == 1
    for name in HOSTILE:
        assert found.text.count(name) > 3


def test_several_runs_stand_in_one_verdict_where_targets_match(side_by_side):
    text = _read(side_by_side).text
    assert "first and other: Town, small" in text
    assert "Of all" not in text  # there is one question
    assert "ED-DC (first) has the highest mean IoU of known classes" in text
    assert "BL-DC (other) is BL-DC (first) by another name" in text
    assert "ED-DC (other) \N{MINUS SIGN} BL-DC (first)" in text
    assert "ED-DC (other) \N{MINUS SIGN} ED-DC (first)" in text
    assert "BL-DC (first)" in text
    for number in (1, 2):
        assert (side_by_side.parent / f"matrix-{number}.yaml").is_file()


@pytest.mark.slow
def test_a_row_by_another_name_is_said_and_not_listed_twice(reference_page):
    found = _read(reference_page)
    assert "ED-SL2 is ED-DC by another name: the same settings, so listed once." in found.text
    assert "ED-SL2" not in (reference_page.parent / "tables" / "categories.csv").read_text()
    assert "ED-SL2" in read_json(reference_page.parent / "report.json")["rows"]
    assert "With a third input, ED-SL3 is at least equal to ED-SL2 (at most 0.02 IoU below) undecided" in found.text


def test_names_of_rows_are_said_in_words(reference_page):
    text = _read(reference_page).text
    assert "ED-DC, ED-Sp1" in text
    for words in ("sensors split2_upper + split2_lower", "3 inputs", "1.18 s ahead", "inputs not moved"):
        assert words in text


def test_rows_on_another_grid_are_not_subtracted_and_the_page_says_why(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1), FakeRow("fine", "ED", 0.1, 1, cell_m=0.5))
    page = _report_of(tmp_path, rows=rows)
    text = _read(page).text
    assert "ED-DC \N{MINUS SIGN} BL-DC" in text
    assert "ED-fine \N{MINUS SIGN}" not in text
    assert "Not compared with BL-DC and the rows that share its targets." in text
    assert "Not compared with these, since their targets are others: ED-fine (grid.cell_m 0.78125 to 0.5)." in text
    assert "ED-fine grid.cell_m 0.78125 to 0.5 (against ED-DC)" in text
    assert read_json(page.parent / "report.json")["rows"]["ED-fine"]["reference"] is None


@pytest.mark.slow
def test_runs_with_different_windows_are_not_subtracted_and_the_page_says_why(tmp_path):
    runs = [
        make_fake_run(tmp_path / name, rows=(FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1)), recordings=count)
        for name, count in (("whole", 3), ("part", 2))
    ]
    text = _read(write_report(runs, tmp_path / "report")).text
    assert "ED-DC (part) \N{MINUS SIGN} BL-DC (part)" in text
    assert "(part) \N{MINUS SIGN} ED-DC (whole)" not in text
    assert "since their targets are others: BL-DC (part), ED-DC (part) (the logs or their frames)." in text
    assert "This rests on 6 windows from 3 recordings and 1 seed" in text
    assert "BL-DC (part), ED-DC (part) the logs or their frames (against BL-DC (whole)) 4 4 shared" in text


def test_names_that_would_move_a_cursor_are_escaped_on_the_page_and_in_its_files(tmp_path):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "BL"),), recordings=2, windows=1)
    record, odd = read_run(run), "\x1b[31m\u202ered"
    (row,) = record.rows
    rows = (row.model_copy(update={"name": odd, "label": odd}),)
    write_run(run, record.model_copy(update={"title": odd, "rows": rows, "failed_logs": {odd: odd}}))
    page = write_report(run)
    for path in (page, *page.parent.rglob("*.csv"), *page.parent.rglob("*.md"), *page.parent.rglob("*.json")):
        text = path.read_text()
        assert "\x1b" not in text, path
        assert "\u202e" not in text, path
    assert "\\x1b[31m\\u202ered" in page.read_text()
