import io
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.fake_run import FakeRow, counted_row, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.figures.categories import category_plots, horizon_plots, lay_out
from semgrid_eval.report.figures.style import INK, PALETTE, family_colours
from semgrid_eval.report.rows.load import load_runs

ROWS = (
    FakeRow("DC", "ED", 0.05, 1),
    FakeRow("DC", "BL"),
    FakeRow("PH1", "ED", 0.2, 1, horizon_steps=2),
    FakeRow("NT", "BL", translate=False),
    FakeRow("SL3", "ED", 0.2, 1, inputs=3),
    FakeRow("Sp2", "ED", 0.2, 1, sensors=("lower", "upper")),
    FakeRow("fine", "ED", 0.2, 1, cell_m=0.5),
    FakeRow("mine", "BL", 0.2, 1, baseline=False),
)


def _scores(rows):
    return score_rows(rows, np.random.default_rng(0), draws=10)


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=ROWS, recordings=2, windows=1)
    return _scores(load_runs([run])[0].rows)


def _plot(scores):
    (plot,) = category_plots(scores)
    return plot


def _texts(svg):
    """Where each text of a drawing stands: x and y in points, y downwards."""
    texts = [each for each in ET.fromstring(svg).iter() if each.tag.endswith("text")]
    return {each.text: (float(each.get("x") or 0), float(each.get("y") or 0)) for each in texts}


def test_rows_of_one_question_stand_together_baselines_first_with_gaps_between(scores):
    assert [(group.words, group.places) for group in lay_out(scores)] == [
        ("2 inputs, sensor front, 0.29 s ahead", {"BL-DC": 0, "ED-DC": 1, "BL-mine": 2}),
        ("0.59 s ahead", {"ED-PH1": 4}),
        ("inputs not moved to the target's time", {"BL-NT": 6}),
        ("3 inputs", {"ED-SL3": 8}),
        ("sensors lower + upper", {"ED-Sp2": 10}),
        ("other targets", {"ED-fine": 12}),
    ]


def test_each_row_is_named_in_full_and_each_question_in_words(scores):
    texts = _texts(_plot(scores).svg)
    assert set(scores) | {group.words for group in lay_out(scores)} <= set(texts)
    assert f"{scores['ED-DC'].mean['vehicles']:.2f}" in texts
    assert texts["BL-DC"][1] < texts["ED-DC"][1] < texts["ED-PH1"][1]


def test_one_question_needs_no_words():
    rows = [counted_row(name, {"car": [60, 80]}) for name in ("ED-DC", "BL-DC")]
    texts = _texts(_plot(_scores(rows)).svg)
    assert not any("ahead" in (text or "") for text in texts)


def test_families_have_one_colour_each_those_of_baselines_first(scores):
    rows = [entry.row for entry in scores.values()]
    assert family_colours(rows) == {"BL": PALETTE[0], "ED": PALETTE[1]}
    assert list(family_colours(row for row in rows if not row.is_baseline)) == ["ED", "BL"]


def test_the_panels_of_all_categories_name_the_rows_once(scores):
    plot = _plot(scores)
    texts = [each.text for each in ET.fromstring(plot.svg).iter() if each.tag.endswith("text")]
    assert texts.count("ED-DC") == 1
    assert {"Static", "Small static", "Vehicles", "Small dynamic", "BL", "ED"} <= set(texts)
    assert Image.open(io.BytesIO(plot.png)).width > 1500
    assert category_plots({}) == []


def test_a_panel_says_what_it_rests_on(scores):
    panel = _plot(scores)
    assert "(2 windows a row, 2 recordings)" in panel.caption
    assert "diamonds are the paper's values" in panel.caption
    assert panel.source == "summary.csv"


def test_more_rows_make_a_panel_higher_and_no_wider(scores):
    few, many = (_plot(dict(list(scores.items())[:n])) for n in (2, 8))
    assert few.width_px == many.width_px
    few, many = (float(ET.fromstring(plot.svg).get("height").removesuffix("pt")) for plot in (few, many))
    assert few < many


def test_rows_that_the_paper_lacks_have_no_diamonds(scores):
    assert "diamonds" not in _plot({"ED-fine": scores["ED-fine"]}).caption


def test_the_drawing_in_a_page_keeps_its_text_and_follows_the_theme(scores):
    panel = _plot(scores)
    inline = panel.inline_svg.replace("xlink:href", "href")  # a page knows the prefix
    assert list(_texts(inline).values()) == list(_texts(panel.svg).values())
    assert INK in panel.svg
    assert INK not in inline
    assert "var(--ink)" in inline
    assert "http:" not in inline


def test_names_of_parts_of_drawings_are_their_own_on_a_page(scores):
    names = re.findall(r' id="([^"]*)"', _plot(scores).inline_svg)
    used = re.findall(r'(?:url\(|href=")#([^)"]*)', _plot(scores).inline_svg)
    assert set(names) == set(used)
    assert all(name.startswith("categories-") for name in names)


def test_parts_of_a_drawing_tell_their_rows_and_have_ids_of_their_own(tmp_path):
    rows = tuple(FakeRow(f"PH{at}", "BL", horizon_steps=at) for at in (1, 2))
    loaded = load_runs([make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1)])[0].rows
    (plot,) = horizon_plots(_scores(loaded))
    assert 'data-row="1 2"' in plot.inline_svg
    ids = re.findall(r' id="([^"]*)"', plot.svg)
    assert len(ids) == len(set(ids))


def test_names_in_any_script_are_drawn(scores):
    entry = scores["ED-DC"]
    facts = entry.row.record.facts.model_copy(update={"family": "\u6a21\u578b \x1b[0m"})
    record = entry.row.record.model_copy(update={"facts": facts})
    odd = {"\u9053\u8def": replace(entry, row=replace(entry.row, name="\u9053\u8def", record=record))}
    assert {"\u9053\u8def", "\u6a21\u578b  [0m"} <= set(_texts(_plot(odd).svg))
