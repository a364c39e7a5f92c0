"""The time that answers are for, worked out by hand for frames 100 ns apart."""

import numpy as np
import pytest

from semgrid_eval.streams.leads import REMEMBERED, Drive, times_asked
from semgrid_eval.streams.schedule import newest_at, one_worker

CAPTURES = np.arange(8, dtype=np.int64) * 100
ANY = (0, 1 << 62)


def drive(latency, *, rule="newest", lead=2):
    """One worker whose work takes as long for each frame: its answers, and when they are used at each capture."""
    took = np.broadcast_to(np.asarray(latency, np.int64), (len(CAPTURES),))
    answers = one_worker(CAPTURES, took, first=1, rule=rule)
    used = newest_at(CAPTURES, CAPTURES[answers.frame], answers.publish_ns)
    return answers, Drive(CAPTURES, CAPTURES, used, lead)


def asked(how, latency, limits=ANY, **changes):
    return times_asked(how, *drive(latency, **changes), limits).tolist()


def test_what_is_captured_and_what_has_a_fixed_lead_depend_on_no_answer():
    # Frames 1, 3, 6 and 7 are worked on, see tests/streams/test_schedule.py.
    assert asked("capture", 250) == [100, 300, 600, 700]
    assert asked("fixed", 250) == [300, 500, 800, 900], "beyond the last frame as if they went on"
    assert asked("fixed", 250, limits=(0, 50)) == [300, 500, 800, 900], "limits are for what is asked online"


def test_known_is_the_middle_of_the_times_at_which_an_answer_is_the_newest():
    # Published at 350, 600, 850 and 1100: the first is used at 400 and 500, the second at 600 and 700.
    assert asked("known", 250) == [400, 600, 850, 1100], "what is never used is for when it is published"
    assert asked("known", 250, limits=(0, 200)) == [300, 500, 800, 900]
    assert asked("known", 250, limits=(450, 1 << 62)) == [550, 750, 1050, 1150]


def test_adaptive_expects_the_latency_and_half_the_spacing_of_past_answers():
    # Begun at 100, 350, 600 and 850. The first expects its own 250 and as much between answers; so does the second,
    # which begins as the first one ends; then two past answers are 250 apart.
    assert asked("adaptive", 250) == [100 + 250 + 125, 350 + 250 + 125, 600 + 250 + 125, 850 + 250 + 125]


def test_adaptive_learns_only_from_answers_that_are_there():
    # Begun at 100, 200, 300, 500, 600 and 700; the third takes 150.
    took = [50, 50, 50, 150, 50, 50, 50, 50]
    answers, where = drive(took)
    assert answers.begin_ns.tolist() == [100, 200, 300, 450, 500, 600, 700]
    found = times_asked("adaptive", answers, where, ANY).tolist()
    assert found[:3] == [100 + 50 + 50, 200 + 50 + 50, 300 + 50 + 50], "the slow one is not expected"
    assert found[3] == 450 + round((50 + 50 + 150) / 3 - 0.5) + (450 - 150) // 2 // 2


def test_adaptive_waits_with_a_worker_that_waits():
    # By sAP's rule it begins at 100, 300, 500: 150 of work ends half a frame before the next one begins.
    answers, where = drive(150, rule="shrinking_tail")
    assert answers.begin_ns.tolist() == [100, 300, 500, 700]
    found = times_asked("adaptive", answers, where, ANY).tolist()
    assert found == [100 + 150 + 75, 300 + 150 + 75, 500 + 150 + 100, 700 + 150 + 100], "200 apart once that is known"


def test_only_the_last_answers_are_remembered():
    captures = np.arange(40, dtype=np.int64) * 100
    took = np.where(np.arange(40) < 20, 90, 30)
    answers = one_worker(captures, took, first=0)
    used = newest_at(captures, captures[answers.frame], answers.publish_ns)
    found = times_asked("adaptive", answers, Drive(captures, captures, used, 1), ANY) - answers.begin_ns
    assert found[19] == 90 + 50
    assert found[20 + REMEMBERED] == 30 + 50


@pytest.mark.parametrize("how", ["capture", "fixed", "adaptive", "known", "exact"])
def test_without_answers_nothing_is_asked(how):
    answers = one_worker(CAPTURES[:1], np.zeros(1, np.int64), first=1)
    assert len(times_asked(how, answers, Drive(CAPTURES[:1], CAPTURES[:1], np.array([-1]), 1), ANY)) == 0
