"""When answers begin, when they are there, and which is the newest: by hand, and against slow twins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_eval.streams.schedule import NONE, many_workers, newest_at, one_worker

CAPTURES = np.arange(8, dtype=np.int64) * 100


def constant(latency):
    return np.full(len(CAPTURES), latency, np.int64)


def test_one_worker_skips_what_comes_while_it_works():
    answers = one_worker(CAPTURES, constant(250), first=1)
    assert answers.frame.tolist() == [1, 3, 6, 7]
    assert answers.begin_ns.tolist() == [100, 350, 600, 850]
    assert answers.publish_ns.tolist() == [350, 600, 850, 1100]


def test_one_worker_that_is_fast_waits_for_each_frame():
    answers = one_worker(CAPTURES, constant(40), first=0)
    assert answers.frame.tolist() == list(range(8))
    assert answers.publish_ns.tolist() == (CAPTURES + 40).tolist()


def test_no_latency_at_all_answers_each_frame_at_its_capture():
    assert one_worker(CAPTURES, constant(0), first=2).publish_ns.tolist() == CAPTURES[2:].tolist()


def test_a_shrinking_tail_waits_where_that_costs_no_answer_in_time():
    # Free at 150, half a frame after a capture: beginning at once ends at a capture, so it waits for the frame of 200.
    greedy = one_worker(CAPTURES, constant(150), first=0)
    patient = one_worker(CAPTURES, constant(150), first=0, rule="shrinking_tail")
    assert greedy.begin_ns.tolist()[:4] == [0, 150, 300, 450]
    assert patient.begin_ns.tolist()[:4] == [0, 200, 400, 600]
    # A tail that grows, from 0 to .3 to .6 to .9 of a frame, is no reason to wait; from .9 it would shrink to .2.
    grows = one_worker(CAPTURES, constant(130), first=0, rule="shrinking_tail")
    assert grows.begin_ns.tolist()[:4] == [0, 130, 260, 400]


def test_many_workers_begin_with_every_frame():
    answers = many_workers(CAPTURES, constant(250), first=2)
    assert answers.frame.tolist() == [2, 3, 4, 5, 6, 7]
    assert answers.publish_ns.tolist() == [450, 550, 650, 750, 850, 950]


def slow_schedule(captures, latencies, first):
    """Walk through time one nanosecond after the other."""
    found, busy_until, newest = [], -1, first - 1
    for now in range(int(captures[-1]) + 1 + int(latencies.max()) * len(captures)):
        if now < busy_until:
            continue
        there = [i for i, captured in enumerate(captures) if captured <= now and i > newest]
        if there:
            newest, busy_until = there[-1], now + int(latencies[there[-1]])
            found.append((newest, now, busy_until))
            if busy_until == now:  # done at once
                busy_until = -1
    return found


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(1, 9), min_size=2, max_size=9),
    st.lists(st.integers(1, 20), min_size=9, max_size=9),
    st.integers(0, 1),
)
def test_one_worker_does_what_walking_through_time_does(gaps, latencies, first):
    captures = np.cumsum(gaps).astype(np.int64)
    took = np.array(latencies[: len(captures)], np.int64)
    answers = one_worker(captures, took, first)
    assert list(zip(*(part.tolist() for part in answers), strict=True)) == slow_schedule(captures, took, first)


def slow_newest(times, answers):
    found = []
    for now in times:
        there = [(capture, aim, publish, i) for i, (capture, publish, aim) in enumerate(answers) if publish <= now]
        best = max(there, default=None, key=lambda each: each[:3])
        found.append(None if best is None else best[:3])
    return found


times = st.integers(0, 12)


@settings(max_examples=200, deadline=None)
@given(st.lists(times, max_size=8), st.lists(st.tuples(times, times, times), max_size=10), st.randoms())
def test_the_newest_answer_is_that_of_a_slow_search_in_any_order(evaluated, answers, chance):
    expected = slow_newest(evaluated, answers)
    chance.shuffle(answers)
    columns = np.array(answers, np.int64).reshape(-1, 3).T
    capture, publish, aim = columns
    found = newest_at(np.array(evaluated, np.int64), capture, publish, aim)
    shown = [None if i == NONE else (capture[i], aim[i], publish[i]) for i in found]
    assert shown == expected


def test_before_the_first_answer_there_is_none():
    capture, publish = np.array([0, 100]), np.array([150, 250])
    assert newest_at(np.array([0, 149, 150, 300]), capture, publish).tolist() == [NONE, NONE, 0, 1]
    assert newest_at(np.array([5]), np.empty(0, np.int64), np.empty(0, np.int64)).tolist() == [NONE]


@pytest.mark.parametrize("rule", ["newest", "shrinking_tail"])
def test_who_has_no_frame_answers_nothing(rule):
    assert len(one_worker(CAPTURES, constant(10), first=8, rule=rule).frame) == 0
