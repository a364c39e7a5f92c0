"""What `check` finds about calibrations, pictures and labels."""

from dataclasses import replace

import numpy as np
import pytest
from support.checked_logs import findings, smooth, with_frame
from support.driving import CALIBRATION, driving

from semgrid_eval.config import parse_config
from semgrid_eval.log.check import check_log
from semgrid_eval.log.contract import Contract
from semgrid_eval.log.findings import Severity
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.png import encode_gray


@pytest.mark.parametrize(
    ("field", "value", "place"),
    [
        ("fx_px", 2262.0, "calibration: fx_px / width"),
        ("fy_px", 140.0, "calibration: fy_px / fx_px"),
        ("v0_px", 400.0, "calibration: v0_px / height"),
        ("baseline_m", 209.0, "stereo: baseline_m"),
        ("z_m", -1.2, "stereo: z_m"),
        ("pitch_rad", 2.2, "stereo: pitch_rad"),
    ],
)
def test_implausible_calibration_is_a_warning(tmp_path, field, value, place):
    found = findings(tmp_path, calibrations={"front": replace(CALIBRATION, **{field: value})})
    assert found[f"/camera/front/{place}"][0] is Severity.WARNING


def test_pictures_of_different_size_are_an_error(tmp_path):
    small = encode_gray(np.zeros((16, 32), np.uint8))
    found = findings(tmp_path, lambda number, moment: with_frame(moment, label_png=small) if number == 6 else moment)
    severity, message = found["camera front"]
    assert severity is Severity.ERROR
    assert message.endswith("ns: label: is 32 x 16, not 64 x 32")


def test_empty_disparity_is_a_warning(tmp_path):
    empty = encode_gray(np.zeros((32, 64), np.uint16))
    found = findings(tmp_path, lambda number, moment: with_frame(moment, disparity_png=empty))
    expected = (Severity.WARNING, "is 0 (allowed: at least 0.02)")
    assert found["/camera/front/disparity: valid_share"] == expected


def with_labels(moment, highest):
    return with_frame(moment, label_png=encode_gray(np.full((32, 64), highest, np.uint8)))


def test_labels_that_look_like_train_ids_are_one_warning_a_log(tmp_path):
    what = "the largest id is 18, so they look like train ids; convert again with --train-ids (allowed: at least 19)"
    expected = (Severity.WARNING, what)
    assert findings(tmp_path, lambda number, moment: with_labels(moment, 18 - number)) == {"labels": expected}

    def two(number, moment):
        (frame,) = with_labels(moment, 18).cameras.values()
        return replace(moment, cameras={"front": frame, "rear": frame})

    both = {"front": CALIBRATION, "rear": CALIBRATION}
    write_log(replace(driving(), moments=lambda: smooth(two), calibrations=both), tmp_path / "two.mcap")
    assert [finding.place for finding in check_log(tmp_path / "two.mcap").findings] == ["labels"]


def test_one_larger_label_in_a_whole_log_says_that_they_are_label_ids(tmp_path):
    assert findings(tmp_path, lambda number, moment: with_labels(moment, 21 if number == 7 else 7)) == {}


def test_log_without_labels_is_not_said_to_hold_train_ids(tmp_path):
    found = findings(tmp_path, lambda number, moment: with_frame(moment, label_png=None))
    assert list(found) == ["/camera/front/label: missing_beside"]


def test_ids_that_only_a_class_set_of_ones_own_knows_are_no_fault(tmp_path):
    assert findings(tmp_path, lambda number, moment: with_labels(moment, 40 + 10 * number)) == {}


def test_train_ids_are_told_where_some_pixels_are_void(tmp_path):
    ids = np.full((32, 64), 255, np.uint8)
    ids[:16] = 13
    found = findings(tmp_path, lambda number, moment: with_frame(moment, label_png=encode_gray(ids)))
    assert found["labels"][1].startswith("the largest id is 13, so they look like train ids")


def test_a_contract_may_say_which_ids_there_are(tmp_path):
    write_log(
        replace(driving(), moments=lambda: smooth(lambda number, moment: with_labels(moment, 40))),
        tmp_path / "log.mcap",
    )
    limits = {"topics": {"/camera/{camera}/label": {"values": {"label_id": {"low": 0, "high": 33}}}}}
    found = check_log(tmp_path / "log.mcap", parse_config(Contract, limits)).findings
    assert [(each.place, each.message) for each in found] == [
        ("/camera/front/label: label_id", "is 40 (allowed: 0 to 33)")
    ]
