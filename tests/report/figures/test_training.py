import io
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.report.estimates.bootstrap import score_rows
from semgrid_eval.report.figures import bars
from semgrid_eval.report.figures import curves as plots
from semgrid_eval.report.figures.style import INK
from semgrid_eval.report.rows.load import load_runs


@pytest.fixture(scope="module")
def rows(run):
    return load_runs([run])[0].rows


@pytest.fixture(scope="module")
def scores(rows):
    return score_rows(rows, np.random.default_rng(0), draws=20)


@pytest.fixture(scope="module")
def panels(scores):
    return bars.category_plots(scores)


def _texts(svg):
    return [element.text for element in ET.fromstring(svg).iter() if element.tag.endswith("text")]


def test_there_is_a_panel_for_each_category_with_every_experiment(panels, scores):
    assert [panel.name for panel in panels] == [
        "category_static",
        "category_small_static",
        "category_vehicles",
        "category_small_dynamic",
    ]
    texts = _texts(panels[2].svg)
    for word in ("DC", "NT", "Fuse", "Sp2", "BL", "ED", "Vehicles", f"{scores['ED-DC'].mean['vehicles']:.2f}"):
        assert word in texts
    assert Image.open(io.BytesIO(panels[0].png)).width > 500


def test_the_themed_drawing_keeps_its_text_and_follows_the_theme(panels):
    panel = panels[0]
    assert _texts(panel.themed_svg) == _texts(panel.svg)
    assert "prefers-color-scheme:dark" in panel.themed_svg
    assert INK not in panel.themed_svg.split("</style>", 1)[1]


def test_trained_rows_have_curves(rows):
    (training,) = plots.training_plots(rows)
    assert {"ED-DC", "ED-Sp2"} <= set(_texts(training.svg))


def test_no_curve_without_training(rows):
    assert plots.training_plots([row for row in rows if row.is_baseline]) == []


def test_a_history_with_other_columns_or_gaps_is_no_obstacle(rows):
    row = next(row for row in rows if row.name == "ED-DC")
    object.__setattr__(row.results[0], "history", pd.DataFrame({"epoch": [1, 2], "loss": [np.nan, "bad"]}))
    assert len(plots.training_plots([row])) == 1


def test_several_horizons_give_a_curve_over_steps_and_seconds(tmp_path):
    steps = [FakeRow("DC", "ED", 0.1, 1), FakeRow("PH1", "ED", 0.2, 1, horizon_steps=2)]
    run = make_fake_run(tmp_path / "run", rows=tuple(steps), recordings=2, windows=1)
    scores = score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=2)
    (plot,) = plots.horizon_plots(scores)
    assert plot.name == "horizon"
    assert plot.source == "summary.csv"
    assert "0.29 s" in _texts(plot.svg)  # the time from the newest input to the target


def test_names_in_any_script_are_drawn(rows, scores):
    entry = scores["ED-DC"]
    record = entry.row.record.model_copy(update={"model": "\u6a21\u578b \x1b[0m", "experiment": "DC"})
    odd = {"odd": replace(entry, row=replace(entry.row, name="\u9053\u8def", record=record))}
    panel = bars.category_plot(odd, ("static",), "odd")
    assert "\u9053\u8def" in _texts(panel.svg)
    assert "\u6a21\u578b  [0m" in _texts(panel.svg)


def test_one_horizon_gives_none(scores):
    assert plots.horizon_plots(scores) == []
