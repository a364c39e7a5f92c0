"""The recording that plays as answers come: answers are moved along, and blank until the first one."""

import base64
import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.scoring import score_rows
from support.streams import stream

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES
from semgrid_eval.report.estimates.streams import strategies
from semgrid_eval.report.examples.stream_reel import moved, stream_reel
from semgrid_eval.scores.results import STREAM_FILE

MASKED, POINTLESS = CLASS_COUNT, CLASS_COUNT + 1  # in the legend
CELL_M = 0.78125


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ((0, 0), [[1, 2], [3, 4]]),
        ((1, 0), [[0, 0], [1, 2]]),
        ((-1, 1), [[0, 3], [0, 0]]),
        ((0, -1), [[2, 0], [4, 0]]),
        ((9, 0), [[0, 0], [0, 0]]),
    ],
)
def test_content_moves_down_and_to_the_right(cells, expected):
    assert moved(np.array([[1, 2], [3, 4]], np.uint8), np.array(cells)).tolist() == expected


def _kept(folder, row):
    """Write what a stream keeps: one answer, used at the second and third time, then 2 cells farther on."""
    grid = np.zeros((128, 128), np.uint8)
    grid[60, 64] = 1
    folder.mkdir()
    away_m = np.array([[0.0, 0.0], [0.0, 0.0], [2 * CELL_M, 0.0]])
    arrays = {
        "prediction": grid[None],
        "certainty": grid[None],
        **dict.fromkeys(("for_ns", "capture_ns", "publish_ns"), np.zeros(1, np.int64)),
        **dict.fromkeys(("answer_m", "publish_m"), np.zeros((1, 2))),
        "evaluated_ns": np.array([0, 10**9, 2 * 10**9]),
        "evaluated_m": away_m,
        "used": np.array([-1, 0, 0]),
        "target": np.stack([grid] * 3),
        "mask": np.stack([grid == 1] * 3),
    }
    write_arrays(folder / STREAM_FILE, arrays, owner=folder.name)
    return replace(row, results=(replace(row.results[0], folder=folder),))


def _ids(picture):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(picture.uri.partition(",")[2]))))


def test_answers_are_blank_until_there_is_one_and_then_moved_along(tmp_path):
    rows = [
        _kept(tmp_path / "moved", stream("newest", 60, delay=200.0, measured=True)),
        _kept(tmp_path / "still", stream("still", 50, delay=200.0, measured=True, moved=False)),
    ]
    reel = stream_reel(strategies(score_rows(rows, 0)), DEFAULT_CLASSES)
    assert [picture.title for picture in reel.strips[0].pictures] == ["Measured", "newest", "still"]
    assert reel.moments == ("1 of 3, 0.0 s", "2 of 3, 1.0 s", "3 of 3, 2.0 s")
    measured, along, still = map(_ids, reel.strips[0].pictures)
    assert (along[:, :128] == POINTLESS).all()
    assert np.argwhere(along[:, 128:] == 1).tolist() == [[60, 64], [62, 128 + 64]]
    assert np.argwhere(still[:, 128:] == 1).tolist() == [[60, 64], [60, 128 + 64]]
    assert (measured == MASKED).sum() == 3


def test_without_what_streams_keep_there_is_nothing_to_play(tmp_path):
    assert stream_reel([], DEFAULT_CLASSES) is None
    row = stream("newest", 60, delay=200.0, measured=True)
    lost = replace(row, results=(replace(row.results[0], folder=tmp_path),))
    assert stream_reel(strategies(score_rows([lost], 0)), DEFAULT_CLASSES) is None
