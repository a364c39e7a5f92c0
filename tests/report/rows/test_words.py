from dataclasses import replace

import pytest
from support.fake_run import counted_row

from semgrid_eval.report.rows.words import model_words, otherwise_asked, question_words, same_rows


def _row(name="ED-DC", label="", **facts):
    row = counted_row(name, {"car": [50, 60]})
    changed = row.record.facts.model_copy(update=facts)
    record = row.record.model_copy(update={"facts": changed, "label": label or row.record.label, "results": (name,)})
    return replace(row, record=record)


@pytest.mark.parametrize(
    ("label", "words"),
    [
        ("ED-DC (encoder-decoder d 3, f 32, moved to the target's time, 2 inputs)", "encoder-decoder d 3, f 32"),
        ("ED-DC (exact world, 15 draws, not moved, 2 inputs)", "exact world, 15 draws"),
        ("ED-DC (answers made elsewhere)", "answers made elsewhere"),
        ("ED-DC: network", "network"),
        ("ED-DC", ""),
    ],
)
def test_what_a_model_does_is_the_part_of_the_label_before_its_inputs(label, words):
    assert model_words(_row(label=label)) == words


def test_a_question_is_said_whole_once_and_then_as_far_as_it_differs():
    first = _row()
    assert question_words(first, first) == "2 inputs, sensor front, 0.29 s ahead"
    assert question_words(_row(inputs=5, sensors=("a", "b")), first) == "5 inputs, sensors a + b"
    assert question_words(_row(disturbed="inputs late"), first) == "inputs late"


def test_what_two_rows_are_asked_is_said_from_both_sides():
    first, other = _row(), _row(translate=False, lead_ms=118.0)
    assert otherwise_asked(first, _row()) == ""
    assert otherwise_asked(other, first) == "118 ms ahead, inputs not moved to the target's time"
    assert otherwise_asked(first, other) == "0.29 s ahead, inputs moved to the target's time"


def test_a_row_with_the_results_of_an_earlier_one_is_that_one():
    rows = [_row("a"), _row("b"), replace(_row("a"), name="c")]
    empty = rows[0].record.model_copy(update={"results": ()})
    left = [replace(rows[0], name=name, record=empty) for name in ("d", "e")]
    assert same_rows([*rows, *left]) == {"c": "a"}
