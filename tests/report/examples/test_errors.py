import base64
import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.report.examples.errors import FEWEST_WINDOWS, error_maps, error_share
from semgrid_eval.report.rows.load import load_runs


def test_a_cell_is_wrong_as_often_as_its_known_class_is_missed():
    target = np.array([[[1, 1, 0]], [[1, 2, 1]], [[1, 2, 1]], [[2, 2, 1]]], np.uint8)  # (4, 1, 3)
    prediction = np.array([[[1, 3, 5]], [[1, 2, 2]], [[3, 2, 2]], [[2, 0, 2]]], np.uint8)
    mask = np.zeros(target.shape, bool)
    mask[3, 0, 1] = True
    share = error_share(target, prediction, mask)
    assert share[0].tolist() == pytest.approx([1 / 4, 1 / 3, 1.0])
    assert np.isnan(error_share(target[: FEWEST_WINDOWS - 1], prediction[: FEWEST_WINDOWS - 1], mask[:2])).all()


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    kinds = (FakeRow("DC", "BL"), FakeRow("good", "ED", 0.02, 1), FakeRow("bad", "ED", 0.4, 1))
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=kinds, recordings=5, windows=1)
    return load_runs([run])[0].rows


def test_rows_have_maps_in_their_order_on_one_scale_and_the_worse_one_is_darker(rows):
    found = error_maps(rows)
    assert [(each.name, each.number) for each in found.maps] == [("BL-DC", 1), ("ED-good", 2), ("ED-bad", 3)]
    assert 0 < found.highest <= 100
    good, bad = (float(each.mean.removesuffix("%")) for each in found.maps[1:])
    assert good < bad
    light, dark = (_brightness(each.uri) for each in found.maps[1:])
    assert light > dark


def test_a_row_without_predictions_has_no_map(rows, tmp_path):
    lost = replace(rows[1], results=(replace(rows[1].results[0], folder=tmp_path),))
    assert [each.name for each in error_maps([rows[0], lost]).maps] == ["BL-DC"]
    assert error_maps([]).maps == ()


def _brightness(uri):
    picture = Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))).convert("RGBA")
    pixels = np.asarray(picture).reshape(-1, 4)
    return pixels[pixels[:, 3] > 0, :3].mean()
