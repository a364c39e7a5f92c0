from collections import Counter

import numpy as np
import pytest

from semgrid_eval.sources.ros2.arrivals import Arrivals, Ledger
from semgrid_eval.sources.ros2.frames import FramePlan, covered, frames_of, stretches
from semgrid_eval.sources.ros2.mapping import CameraMap

MS = 1_000_000
CAMERA = CameraMap(info="/info", rectified=True, disparity="/disparity", labels="/labels")


def arrivals(topic, stamps_ms):
    stamps_ns = np.array(stamps_ms, np.int64) * MS
    return Arrivals(topic, stamps_ns, stamps_ns + 1, np.arange(len(stamps_ns), dtype=np.uint64), 0)


def plans(stamps_ms, camera="front"):
    return [FramePlan(camera, stamp * MS, {}) for stamp in stamps_ms]


def numbers(found):
    return [(first, [each.stamp_ns // MS for each in frames]) for first, frames in found]


def test_the_nearest_label_within_the_tolerance_belongs_to_a_frame():
    known = {
        "/disparity": arrivals("/disparity", [0, 100, 200, 300]),
        "/labels": arrivals("/labels", [4, 93, 107, 280]),
    }
    lost = Counter()
    found = frames_of("front", CAMERA, known, 0.01, lost)
    assert [(each.stamp_ns // MS, each.pieces["labels"].stamp_ns // MS) for each in found] == [(0, 4), (100, 93)]
    assert lost == {"without labels": 2, "without disparity": 0}


def test_one_message_is_nearest_to_everything():
    assert arrivals("/a", [5]).nearest(np.array([0, 10**9])).tolist() == [0, 0]


def test_of_equal_stamps_the_first_counts():
    ledger = Ledger("/a")
    for digest, stamp in enumerate([10, 20, 20, 30], start=1):
        ledger.add(stamp, stamp, digest)
    found = ledger.close()
    assert found.digests.tolist() == [1, 2, 4]
    assert found.repeated == 1


def test_messages_may_overtake_each_other_a_little():
    ledger = Ledger("/a")
    for stamp_ms in (100, 133, 120, 166):
        ledger.add(stamp_ms * MS, 1000 * MS + stamp_ms * MS)
    assert (ledger.close().stamps_ns // MS).tolist() == [100, 120, 133, 166]


def test_frames_far_from_motion_are_left_out():
    lost = Counter()
    motion_ns = np.array([100, 200, 300, 1000, 1100], np.int64) * MS
    found = covered(plans([0, 150, 310, 600, 990, 1300, 1400]), motion_ns, lost)
    assert [each.stamp_ns // MS for each in found] == [0, 150, 1300]
    assert lost["without motion"] == 4


def test_recordings_end_where_frames_are_missing():
    lost = Counter()
    found = stretches({"front": plans([0, 50, 100, 200, 250, 400, 500, 550])}, set(), 0.0, lost)
    assert numbers(found) == [(0, [0, 50, 100]), (3, [200, 250]), (6, [500, 550])]
    assert lost["where a sensor has fewer than two"] == 1


def test_long_stretches_are_cut_into_equal_parts():
    found = stretches({"front": plans(range(0, 1000, 50))}, set(), 0.4, Counter())
    assert [first for first, _ in found] == [0, 7, 13]
    assert sum(len(frames) for _, frames in found) == 20


def test_a_hole_of_one_camera_ends_the_recording_of_all():
    front, rear = plans(range(0, 500, 50)), plans([10, 60, 110, 310, 360, 410], "rear")
    found = numbers(stretches({"front": front, "rear": rear}, set(), 0.0, Counter()))
    assert found == [(0, [0, 10, 50, 60, 100, 110, 150, 200, 250, 300]), (7, [310, 350, 360, 400, 410, 450])]


def test_a_hole_of_a_single_camera_ends_nothing():
    front, rear = plans(range(0, 500, 50)), plans([10, 60, 110, 310, 360, 410], "rear")
    ((first, frames),) = stretches({"front": front, "rear": rear}, {"rear"}, 0.0, Counter())
    assert (first, len(frames)) == (0, 16)


@pytest.mark.parametrize("rear_ms", [range(410, 1000, 50), range(10, 500, 50), [110], []])
@pytest.mark.parametrize("first", ["front", "rear"])
def test_a_single_camera_that_starts_late_or_dies_takes_no_frame_of_others_away(rear_ms, first):
    front, lost = plans(range(0, 1000, 50)), Counter()
    by_sensor = {"front": front, "rear": plans(rear_ms, "rear")}
    in_order = {first: by_sensor.pop(first), **by_sensor}
    found = stretches(in_order, {"rear"}, 0.4, lost)
    assert [each for _, frames in found for each in frames if each.sensor == "front"] == front
    assert len({number for number, _ in found}) == len(found) == 3
    assert lost.total() == 0


def test_where_there_are_single_cameras_alone_one_may_die():
    """Recordings are numbered by the frames of both."""
    left, right = plans(range(0, 200, 50), "left"), plans(range(0, 1000, 50), "right")
    found = stretches({"left": left, "right": right}, {"left", "right"}, 0.4, Counter())
    assert [number for number, _ in found] == [0, 11, 17]
    assert sum(len(frames) for _, frames in found) == 24


def test_a_single_frame_of_a_single_camera_is_no_recording():
    lost = Counter()
    assert stretches({"left": plans([50], "left")}, {"left"}, 0.0, lost) == []
    assert lost == {"where a sensor has fewer than two": 1}
