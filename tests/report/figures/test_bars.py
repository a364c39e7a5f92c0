import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import counted_row

from semgrid_eval.report.estimates.bootstrap import score_rows
from semgrid_eval.report.figures.bars import category_plot, lay_out

NAMES = ("BL-DC", "ED-DC", "BL-Sp1", "ED-Sp1", "ED-SL3", "ED-PH1", "BL-Fuse")


@pytest.fixture(scope="module")
def scores():
    rows = [counted_row(name, {"car": [60, 80], "road": [90, 90]}) for name in NAMES]
    return score_rows(rows, np.random.default_rng(0), draws=10)


def test_experiments_stand_in_the_papers_groups_with_gaps_between(scores):
    layout = lay_out(scores)
    assert list(layout.groups.values()) == [["DC", "Fuse"], ["Sp1"], ["SL3"], ["PH1"]]
    assert layout.places == {"DC": 0, "Fuse": 1, "Sp1": 2.5, "SL3": 4, "PH1": 5.5}
    assert list(layout.colours) == ["BL", "ED"]


def test_rows_of_several_runs_keep_their_groups(scores):
    tagged = {
        f"{name} ({run})": replace(entry, row=replace(entry.row, name=f"{name} ({run})"))
        for run in ("a", "b")
        for name, entry in scores.items()
    }
    assert lay_out(tagged).groups["SL: inputs"] == ["SL3 (a)", "SL3 (b)"]


def _places(svg):
    """Where each text of a drawing stands: x and y in points, y downwards."""
    texts = [each for each in ET.fromstring(svg).iter() if each.tag.endswith("text")]
    return {each.text: (float(each.get("x")), float(each.get("y"))) for each in texts}


def test_bars_stand_in_the_order_of_the_legend_whatever_the_order_of_rows():
    rows = [counted_row(name, {"car": [hits, hits]}) for name, hits in (("ED-DC", 70), ("BL-DC", 30))]
    places = _places(category_plot(score_rows(rows, np.random.default_rng(0), draws=2), ("vehicles",), "x").svg)
    assert places["0.30"][0] < places["0.70"][0]
    assert places["BL"][0] < places["ED"][0]


def test_a_number_stands_above_the_papers_mark_where_that_would_lie_on_it():
    def height_of(name):
        rows = [counted_row(name, {"car": [53, 53]}), counted_row("BL-Fuse", {"car": [90, 90]})]
        return _places(category_plot(score_rows(rows, np.random.default_rng(0), draws=2), ("vehicles",), "x").svg)[
            "0.53"
        ][1]

    assert height_of("BL-DC") < height_of("BL-Table")  # the paper has 0.535 for the first and nothing for the second


def test_a_panel_names_its_groups_and_says_what_it_rests_on(scores):
    panel = category_plot(scores, ("vehicles",), "vehicles")
    texts = [element.text for element in ET.fromstring(panel.svg).iter() if element.tag.endswith("text")]
    assert {"SF: sensors fused", "SL: inputs", "PH: horizon", "0.70"} <= set(texts)
    assert "(2 windows a row, 2 recordings)" in panel.caption
    assert "diamonds are the paper's values" in panel.caption
    assert panel.source == "summary.csv"
    assert panel.width_px == pytest.approx(96 * 4.8, abs=1)


def test_rows_that_the_paper_lacks_have_no_diamonds(scores):
    panel = category_plot({"BL-Fuse": scores["BL-Fuse"]}, ("vehicles",), "vehicles")
    assert "diamonds" not in panel.caption
