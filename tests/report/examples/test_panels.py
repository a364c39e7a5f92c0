from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import with_counts

from semgrid_eval.report.examples.choose import Contest, Pick
from semgrid_eval.report.examples.drawing import HATCH_LEGEND, MASK_LEGEND
from semgrid_eval.report.examples.panels import Shown, draw_examples
from semgrid_eval.report.examples.thumbnails import RunThumbnails
from semgrid_eval.report.rows.load import load_runs

PICK = Pick(0, "Largest", 0.25)


def opened(folder):
    """A run and its rows by name."""
    (run,) = load_runs([folder])
    return run, {row.name: row for row in run.rows}


def draw(folder, model, *rivals, picks=(PICK,), baselines=()):
    run, rows = opened(folder)
    contest = Contest(rows[model], tuple(rows[name] for name in rivals), tuple(rows.get(name) for name in baselines))
    return list(draw_examples(Shown(contest, {pick.index for pick in picks}), picks, RunThumbnails(run)))


def kinds(column):
    return [picture.kind for picture in column.pictures]


def test_an_example_shows_inputs_target_predictions_and_certainty(run):
    (example,) = draw(run, "ED-Sp2", "BL-Sp2")
    assert [column.title for column in example.film] == ["Input 1 of 2", "Input 2 of 2", "Target"]
    assert [[picture.title for picture in column.pictures] for column in example.film[:2]] == [["lower", "upper"]] * 2
    assert [column.title for column in example.answers] == ["ED-Sp2", "BL-Sp2", "Who is right", "Certainty"]
    steps = [column.title for column in (*example.film, *example.answers) if column.step]
    assert steps == ["Input 1 of 2", "Input 2 of 2", "Target", "ED-Sp2"]
    assert MASK_LEGEND in example.legend
    assert HATCH_LEGEND not in example.legend
    assert (example.title, example.hatching, example.crops) == ("Largest: +0.250", "", ())


def test_camera_and_segmentation_stand_above_the_grids_of_each_moment(seen):
    (example,) = draw(seen, "own-DC", "BL-DC")
    assert [kinds(column) for column in example.film] == [["camera", "labels", "grid"]] * 3
    notes = ["0.235 s before the target", "0.118 s before the target", "to be predicted"]
    assert [column.note for column in example.film] == notes
    images = {column.pictures[0].uri for column in example.film}
    assert len(images) == 3, "each moment has its own"
    assert all(column.note.startswith("mean IoU 0.") for column in example.answers[:2])
    assert example.times[2] == "0.471 s into the log"
    assert example.command.startswith("semgrid-eval play runs/seen own-DC --logs 'my logs'")


def test_both_sensors_are_shown_with_the_band_that_none_sees(seen):
    (example,) = draw(seen, "own-Sp2", "BL-Sp2")
    assert [kinds(column) for column in example.film] == [["camera", "labels", "grid", "grid"]] * 2 + [
        ["camera", "labels", "grid"]
    ]
    assert example.hatching
    assert HATCH_LEGEND in example.legend
    assert [crop.name for crop in example.crops] == ["split2_upper", "split2_lower"]


def test_horizons_stand_in_a_row_each_with_what_was_known_then(seen):
    (example,) = draw(
        seen, "own-DC", "own-PH1", "own-PH2", baselines=("BL-DC", "BL-PH1", "BL-PH2")
    )  # there is no BL-PH2
    assert [(column.title, column.note) for column in example.film] == [
        ("3 steps ahead", "0.353 s before the target"),
        ("2 steps ahead", "0.235 s before the target"),
        ("1 step ahead", "0.118 s before the target"),
        ("Target", "to be predicted"),
    ]
    titles = [[each.title.split(",")[0] for each in column.pictures if each.kind == "grid"] for column in example.film]
    assert titles == [
        ["Newest input", "own-PH2"],
        ["Newest input", "own-PH1", "BL-PH1"],
        ["Newest input", "own-DC", "BL-DC"],
        ["Target"],
    ]
    assert [[each.lead for each in column.pictures if each.kind == "grid"] for column in example.film] == [
        [False, True],
        [False, True, False],
        [False, True, False],
        [True],
    ]
    assert example.answers == ()
    photos = [column.pictures[0].uri for column in example.film]
    (near,) = draw(seen, "own-DC", "BL-DC")
    assert photos[1:] == [column.pictures[0].uri for column in near.film], "frames are those of the inputs"


def test_windows_are_those_of_the_same_target_whatever_their_order(seen):
    straight = draw(seen, "own-DC", "own-PH1", baselines=("BL-DC", "BL-PH1"), picks=(Pick(0, "a", 0), Pick(1, "b", 0)))
    turned = draw(seen, "own-DC", "own-PH1", baselines=("BL-DC", "BL-PH1"), picks=(Pick(1, "b", 0), Pick(0, "a", 0)))
    assert straight == turned[::-1]


def test_reasons_for_one_window_are_told_together(seen):
    picks = (Pick(1, "Car, largest", 0.1), Pick(0, "Road, only", 0.0), Pick(1, "Road, smallest", -0.2))
    titles = [example.title for example in draw(seen, "own-DC", "BL-DC", picks=picks)]
    assert titles == ["Car, largest: +0.100; Road, smallest: \N{MINUS SIGN}0.200", "Road, only: 0.000"]


@pytest.mark.parametrize(("lengths", "expected"), [((3, 5), 5), ((3, 2), 4), ((6, 5), 6), ((11, 5), 6)])
def test_columns_are_neither_too_wide_nor_too_narrow(seen, lengths, expected):
    (example,) = draw(seen, "own-DC", "BL-DC")
    film, answers = (example.film[:1] * count for count in lengths)
    assert type(example)(**{**vars(example), "film": film, "answers": answers}).columns == expected


def test_a_rival_without_the_window_is_left_out(seen):
    run, rows = opened(seen)
    rival = rows["BL-DC"]
    shown = with_counts(rival.shown, rival.shown.counts[1:], windows=rival.shown.record.windows[1:])
    shorter = replace(rival, results=(shown,))
    (example,) = draw_examples(Shown(Contest(rows["own-DC"], (shorter,)), {PICK.index}), (PICK,), RunThumbnails(run))
    assert [column.title for column in example.answers] == ["own-DC", "Certainty"]
    assert np.all([column.pictures for column in example.answers])
