from itertools import chain

import numpy as np
import pytest

from semgrid_eval.sensors.kinds import TOLERANCE_NS, synchronise
from semgrid_eval.sensors.sensor import Points, SensorConfig

MS = 1_000_000


def seen(name, *times_ms):
    return [Points(name, int(ms * MS), np.zeros(1), np.zeros(1), np.zeros(1, np.uint8)) for ms in times_ms]


def together(*observations, max_age_s=0.1):
    sensors = {name: SensorConfig(kind="any", max_age_s=max_age_s) for name in ("a", "b", "c")}
    merged = sorted(chain(*observations), key=lambda points: points.stamp_ns)
    snapshots = synchronise(merged, sensors, "a")
    return [(stamp_ns // MS, {name: each.stamp_ns / MS for name, each in seen.items()}) for stamp_ns, seen in snapshots]


def test_the_newest_observation_at_or_before_the_leaders_time_counts():
    assert together(seen("b", 0, 30, 50, 80), seen("a", 40, 80), seen("c", 90)) == [
        (40, {"a": 40.0, "b": 30.0}),
        (80, {"a": 80.0, "b": 80.0}),
    ]


@pytest.mark.parametrize("order", [("a", "b"), ("b", "a")])
def test_equal_times_belong_together_in_whatever_order_they_come(order):
    found = together(*(seen(name, 10, 20, 30) for name in order))
    assert found == [(ms, {"a": float(ms), "b": float(ms)}) for ms in (10, 20, 30)]


def test_what_is_a_little_late_is_simultaneous_and_what_is_later_is_not():
    late_ms = TOLERANCE_NS / MS
    assert together(seen("a", 10, 60), seen("b", 10 + late_ms, 60 + late_ms + 0.1)) == [
        (10, {"a": 10.0, "b": 10 + late_ms}),
        (60, {"a": 60.0, "b": 10 + late_ms}),
    ]


def test_old_observations_are_left_out():
    assert together(seen("b", 0), seen("a", 99, 100, 101)) == [
        (99, {"a": 99.0, "b": 0.0}),
        (100, {"a": 100.0, "b": 0.0}),
        (101, {"a": 101.0}),
    ]


def test_without_the_leader_there_is_no_time():
    assert together(seen("b", 0, 10)) == []
