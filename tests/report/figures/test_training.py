import xml.etree.ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from semgrid_eval.report.figures.curves import training_plots
from semgrid_eval.report.rows.load import load_runs


@pytest.fixture
def rows(run):
    return load_runs([run])[0].rows


def test_trained_rows_have_curves(rows):
    (training,) = training_plots(rows)
    texts = {element.text for element in ET.fromstring(training.svg).iter() if element.tag.endswith("text")}
    assert {"ED-DC", "ED-Sp2"} <= texts


def test_no_curve_without_training(rows):
    assert training_plots([row for row in rows if row.is_baseline]) == []


def test_a_history_with_other_columns_or_gaps_is_no_obstacle(rows):
    row = next(row for row in rows if row.name == "ED-DC")
    object.__setattr__(row.results[0], "history", pd.DataFrame({"epoch": [1, 2], "loss": [np.nan, "bad"]}))
    assert len(training_plots([row])) == 1
