import pytest

from semgrid_eval.log.contract import Cameras, Contract, Latency, Range, RangeBeside, TopicContract
from semgrid_eval.log.timing import Times, coverage, latencies, timing

MS = 1_000_000
NONE = Cameras((), ())


def at(*times_ms, delay_ms=0, stamp_ms=0):
    """Messages at these log times, published later, and stamped earlier."""
    return [Times(ms * MS, (ms + delay_ms) * MS, (ms - stamp_ms) * MS) for ms in times_ms]


def told(findings):
    return [(finding.place, finding.message) for finding in findings]


@pytest.mark.parametrize(
    ("field", "limit", "message"),
    [
        ("messages", Range(high=4), "has 5 messages (allowed: at most 4)"),
        ("rate_hz", Range(low=20, high=30), "is 10 Hz (allowed: 20 to 30)"),
        ("gap_s", Range(high=0.25), "has a gap of 0.300 s at a period of 0.100 s (allowed: at most 0.25)"),
        ("gap_periods", Range(high=2), "has a gap of 0.300 s at a period of 0.100 s (allowed: at most 2)"),
        ("jitter_periods", Range(high=0.1), "vary by 150 % of a period (their middle half) (allowed: at most 0.1)"),
    ],
)
def test_each_limit_of_a_topic_is_held(field, limit, message):
    timeline = {"/a": at(0, 100, 200, 300, 600)}
    (found,) = told(timing("/a", TopicContract(**{field: limit}), timeline, ""))
    assert found[0] == f"/a: {field}"
    assert found[1].endswith(message)
    assert told(timing("/a", TopicContract(**{field: Range(low=0, high=50)}), timeline, "")) == []


def test_repeated_times_are_told_instead_of_what_follows_from_them():
    expected = TopicContract(repeated_times=Range(high=0), gap_periods=Range(high=1.5))
    assert told(timing("/a", expected, {"/a": at(0, 0, 100, 900)}, "")) == [
        ("/a: repeated_times", "has 1 message with the time of the message before (allowed: at most 0)")
    ]
    assert told(timing("/a", TopicContract(rate_hz=Range(low=1)), {"/a": at(5, 5, 5)}, "")) == []


def test_a_topic_without_messages_has_only_their_number_wrong():
    expected = TopicContract(messages=Range(low=1), rate_hz=Range(low=1), gap_s=Range(high=1), uncovered_s=beside("/b"))
    timeline = {"/b": at(0, 100)}
    assert [place for place, _ in told(timing("/a", expected, timeline, ""))] == ["/a: messages"]
    assert told(coverage("/a", expected, timeline, NONE)) == []


def beside(topic):
    return RangeBeside(topic=topic, high=0)


def test_messages_missing_beside_others_are_counted_for_the_same_camera():
    expected = TopicContract(missing_beside=beside("/camera/{camera}/a"))
    timeline = {"/camera/x/a": at(0, 100, 200), "/camera/y/a": at(0), "/b": at(0, 150)}
    (found,) = told(timing("/b", expected, timeline, "x"))
    assert found[1] == "is missing for 2 of 3 messages of /camera/x/a (allowed: at most 0)"
    assert told(timing("/b", expected, timeline, "y")) == []


@pytest.mark.parametrize(("times_ms", "outside"), [((0, 300), None), ((100, 300), "0.100"), ((0, 50), "0.250")])
def test_time_that_is_not_covered(times_ms, outside):
    expected = TopicContract(uncovered_s=beside("/camera/{camera}/a"))
    timeline = {"/m": at(*times_ms), "/camera/x/a": at(0, 300)}
    found = told(coverage("/m", expected, timeline, Cameras(("x", "none"), ())))
    text = f"leaves out {outside} s of the time of /camera/x/a (allowed: at most 0)"
    assert found == ([("/m: uncovered_s", text)] if outside else [])


@pytest.mark.parametrize(
    ("latency", "message"),
    [
        ({"topic": "/a"}, "log is up to 0.02 s after stamp in 3 of 3 messages"),
        ({"topic": "/a", "clock": "publish"}, "publish is up to 0.07 s after stamp in 3 of 3 messages"),
        ({"topic": "/a", "clock": "publish", "after_clock": "log"}, "publish is up to 0.05 s after log in 3 of 3"),
        ({"topic": "/b", "after": "/a"}, "log is up to 0.04 s after /a: stamp in 2 of 2 messages"),
        ({"topic": "/b", "after": "/a", "after_clock": "log"}, "log is up to 0.02 s after /a: log in 2 of 2 messages"),
        ({"topic": "/a", "after": "/b", "after_clock": "log"}, "log is before any /b: log in 3 of 3 messages"),
        ({"topic": "/a", "after": "/none"}, "log is before any /none: stamp in 3 of 3 messages"),
    ],
)
def test_latency_by_any_clock_and_after_any_topic(latency, message):
    timeline = {"/a": at(100, 200, 300, delay_ms=50, stamp_ms=20), "/b": at(115, 220)}
    contract = Contract(latencies=(Latency(**latency, seconds=Range(high=0)),))
    (found,) = told(latencies(contract, timeline, NONE))
    assert found[0] == f"{latency['topic']}: latency"
    assert found[1].startswith(message)
    contract = Contract(latencies=(Latency(**latency, seconds=Range(low=0)),))
    assert told(latencies(contract, timeline, NONE)) == []


def test_latency_is_between_topics_of_one_camera():
    contract = Contract(
        latencies=(Latency(topic="/{camera}/b", after="/{camera}/a", after_clock="log", seconds=Range(high=0.01)),)
    )
    timeline = {"/x/a": at(100), "/x/b": at(105), "/y/a": at(100), "/y/b": at(120)}
    assert [place for place, _ in told(latencies(contract, timeline, Cameras(("x",), ("y",))))] == ["/y/b: latency"]


def test_messages_without_stamp_have_no_latency():
    contract = Contract(latencies=(Latency(topic="/a", seconds=Range(high=0)),))
    assert told(latencies(contract, {"/a": [Times(5, 6, None)]}, NONE)) == []
