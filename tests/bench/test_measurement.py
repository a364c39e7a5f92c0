import time
from itertools import count

import pytest

from semgrid_eval.bench.measurement import Measurement, processor_s, times_as_fast, wall_s


@pytest.mark.parametrize(
    ("value", "goal", "words", "is_short"),
    [
        (1.0, {"at_most": 1.0}, "at most 1", False),
        (1.1, {"at_most": 1.0}, "at most 1", True),
        (1.7, {"at_least": 1.7}, "at least 1.7", False),
        (1.6, {"at_least": 1.7}, "at least 1.7", True),
        (9.0, {}, "", False),
    ],
)
def test_a_goal_is_reached_up_to_its_limit(value, goal, words, is_short):
    measured = Measurement("x", value, "s", **goal)
    assert (measured.goal, measured.is_short) == (words, is_short)


def test_the_median_of_pairs_counts():
    now_s, passed = [0.0], iter((1.0, 2.0, 1.0, 9.0, 1.0, 3.0))  # the rival's first, of three pairs

    def work():
        now_s[0] += next(passed)

    assert times_as_fast(work, work, 3, clock=lambda: now_s[0]) == 1.0 / 3.0


def test_the_median_of_repeats_counts():
    pauses = iter((0.0, 0.2, 0.02))
    assert 0.015 < wall_s(lambda: time.sleep(next(pauses)), 3) < 0.15


def test_waiting_is_no_processor_time():
    assert processor_s(lambda: time.sleep(0.1), 1) < 0.05


def test_working_is_processor_time():
    def work():
        start_s = time.process_time()
        for _ in count():
            if time.process_time() - start_s > 0.1:
                break

    assert processor_s(work, 1) == pytest.approx(0.1, abs=0.05)
