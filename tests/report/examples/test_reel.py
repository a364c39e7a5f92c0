"""The grid of examples that plays: which moments it shows, and what each holds."""

import base64
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.fake_run import FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES
from semgrid_eval.report.examples.reel import MOST_MOMENTS, make_reel
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import headline
from semgrid_eval.scores.results import read_predictions, read_windows

MASKED, POINTLESS = CLASS_COUNT, CLASS_COUNT + 1  # in the legend
PAIR = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1))
LATER = tuple(
    FakeRow(f"PH{at}", family, 0.1, int(family == "ED"), horizon_steps=at + 1)
    for at in (1, 2)
    for family in ("BL", "ED")
)


def _rows(tmp_path: Path, rows=PAIR, **options):
    return load_runs([make_fake_run(tmp_path / "run", rows=rows, **options)])[0].rows


def _reel(rows):
    scores = score_rows(rows, 0)
    return make_reel(scores, rows, headline(scores), DEFAULT_CLASSES)


def _titles(reel):
    return [picture.title for picture in reel.strips[0].pictures]


def _ids(picture) -> np.ndarray:
    content = base64.b64decode(picture.uri.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(content)))


def test_windows_of_a_recording_play_in_the_order_of_time(tmp_path):
    rows = _rows(tmp_path, recordings=2, windows=4)
    reel = _reel(rows)
    assert reel.title == "Over time"
    named = {row.name: row.number for row in rows}
    assert _titles(reel) == ["Newest input", "Target", "ED-DC", "BL-DC"]
    assert reel.columns == ((), (), (named["ED-DC"],), (named["BL-DC"],))
    assert reel.moments == ("1 of 4, 0.0 s", "2 of 4, 0.1 s", "3 of 4, 0.1 s", "4 of 4, 0.2 s")
    ed = rows[1].results[0]
    prediction, windows = read_predictions(ed.folder)["prediction"], read_windows(rows[1].run, ed.record.windows_id)
    at = [i for i, each in enumerate(ed.record.windows) if each.recording == reel.strips[0].title.split(",")[0]]
    newest, target, mine, _ = reel.strips[0].pictures
    np.testing.assert_array_equal(_ids(mine), np.concatenate(prediction[at], axis=1))
    np.testing.assert_array_equal(_ids(newest), np.concatenate(windows["inputs"][at, 0, -1], axis=1))
    shown = np.where(windows["mask"][at] > 0, MASKED, windows["target"][at])
    np.testing.assert_array_equal(_ids(target), np.concatenate(shown, axis=1))


def test_no_more_moments_play_than_end_within_five_seconds(tmp_path):
    reel = _reel(_rows(tmp_path, recordings=1, windows=MOST_MOMENTS + 3))
    assert len(reel.moments) == MOST_MOMENTS
    script = (Path(__file__).parents[3] / "semgrid_eval/report/templates/reel.js").read_text()
    (step_ms,) = (int(line.split("=")[1].strip(" ;")) for line in script.splitlines() if "STEP_MS =" in line)
    assert MOST_MOMENTS * step_ms < 5000


def test_one_target_plays_from_the_longest_lead_to_the_shortest(tmp_path):
    rows = _rows(tmp_path, (*PAIR, *LATER), recordings=3, windows=1)
    reel = _reel(rows)
    assert reel.title == "From farther and from nearer"
    assert _titles(reel) == ["Newest input", "Target", "ED-PH2 to ED-DC", "BL-PH2 to BL-DC"]
    asked = [[rows[number - 1].name for number in column] for column in reel.columns]
    assert asked == [[], [], ["ED-PH2", "ED-PH1", "ED-DC"], ["BL-PH2", "BL-PH1", "BL-DC"]]
    assert reel.moments == ("0.88 s ahead", "0.59 s ahead", "0.29 s ahead")
    named = {row.name: row for row in rows}
    at = next(i for i, each in enumerate(rows[0].results[0].record.windows) if each.recording in reel.strips[0].title)
    line = [read_predictions(named[name].results[0].folder) for name in ("ED-PH2", "ED-PH1", "ED-DC")]
    mine = np.concatenate([each["prediction"][at] for each in line], axis=1)
    np.testing.assert_array_equal(_ids(reel.strips[0].pictures[2]), mine)


def test_inputs_play_up_to_the_target_where_predictions_appear(tmp_path):
    rows = _rows(tmp_path, recordings=3, windows=1)
    reel = _reel(rows)
    assert reel.title == "Up to the target"
    assert reel.moments == ("0.59 s before the target", "0.29 s before the target", "the target")
    assert len({strip.title for strip in reel.strips}) == 3
    seen, mine, _ = reel.strips[0].pictures
    assert _ids(seen).shape == (128, 3 * 128)
    assert (_ids(mine)[:, : 2 * 128] == POINTLESS).all()
    assert (_ids(mine)[:, 2 * 128 :] != POINTLESS).all()


@pytest.mark.parametrize("damaged", ["predictions.npz", "windows"])
def test_what_is_damaged_is_not_shown(tmp_path, damaged):
    rows = _rows(tmp_path, recordings=2, windows=1)
    for path in (tmp_path / "run").rglob("*.npz"):
        if damaged in str(path):
            path.write_bytes(b"nothing")
    assert _reel(rows) is None


def test_without_rows_there_is_nothing_to_play(tmp_path):
    rows = [replace(row, results=()) for row in _rows(tmp_path, recordings=1, windows=1)]
    assert make_reel({}, rows, None, DEFAULT_CLASSES) is None
