from dataclasses import replace

from support.fake_run import counted_row

from semgrid_eval.report.rows.words import model_words, otherwise_asked, question_words, same_rows
from semgrid_eval.scores.facts import StreamFacts


def _row(name="ED-DC", words="", **facts):
    row = counted_row(name, {"car": [50, 60]})
    changed = row.record.facts.model_copy(update=facts)
    record = row.record.model_copy(update={"facts": changed, "words": words, "results": (name,)})
    return replace(row, record=record)


def test_models_are_told_apart_by_what_they_do_and_by_whether_their_grids_are_moved():
    words = "encoder-decoder of depth 3, 32 features"
    assert model_words(_row(words=words)) == words
    still = _row(words="newest input", translate=False)
    assert model_words(still) == "newest input, inputs not moved to the target's time"
    stream = StreamFacts(words="", added_ms=0, measured=True, moved=False, asked="capture", model_is_free=False)
    assert (
        model_words(_row(words="newest input", stream=stream))
        == "newest input, answers not moved along with the vehicle"
    )


def test_a_run_of_long_ago_tells_the_names_of_its_models_alone():
    assert model_words(_row()) == "ed"


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
