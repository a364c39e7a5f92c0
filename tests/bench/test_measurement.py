import time
from itertools import count

import pytest

from semgrid_eval.bench.measurement import Measurement, processor_s, wall_s


def test_a_promise_is_kept_up_to_its_limit():
    kept = [Measurement("x", value, "s", limit).kept for value, limit in ((1.0, 1.0), (1.1, 1.0), (9.0, None))]
    assert kept == [True, False, None]


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
