import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.figures.categories import horizon_lines, horizon_plots
from semgrid_eval.report.rows.load import load_runs

ROWS = (
    FakeRow("far", "ED", 0.2, 1, horizon_steps=3),
    FakeRow("DC", "ED", 0.1, 1),
    FakeRow("again", "ED", 0.1, 1),  # means the same
    FakeRow("farther", "ED", 0.2, 1, horizon_steps=4, translate=False),  # differs in more than the horizon
    FakeRow("finest", "ED", 0.2, 1, horizon_steps=4, cell_m=0.5),  # has other targets
    FakeRow("DC", "BL"),
    FakeRow("PH1", "BL", horizon_steps=2),
)


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=ROWS, recordings=2, windows=1)
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=2)


def test_a_line_holds_the_rows_that_differ_in_the_horizon_alone_by_lead(scores):
    names = [[entry.row.name for entry in line] for line in horizon_lines(scores)]
    assert names == [["ED-DC", "ED-far"]]


def test_several_horizons_give_a_curve_over_seconds(scores):
    (plot,) = horizon_plots(scores)
    texts = [element.text for element in ET.fromstring(plot.svg).iter() if element.tag.endswith("text")]
    assert (plot.name, plot.source) == ("horizon", "summary.csv")
    assert {"0.29", "0.88", "ED-DC \N{HORIZONTAL ELLIPSIS} ED-far"} <= set(texts)


def test_one_horizon_gives_none(scores):
    assert horizon_plots({name: scores[name] for name in ("ED-DC", "BL-DC")}) == []
