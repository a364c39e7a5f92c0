"""When the messages of a log come: how many, how often, how steadily, and how long after something else."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from statistics import median, quantiles
from typing import NamedTuple

from semgrid_eval.log.contract import Cameras, Clock, Contract, Latency, Range, TopicContract, topic_beside, topics_of
from semgrid_eval.log.findings import Finding
from semgrid_eval.log.topics import LABEL, camera_topic
from semgrid_eval.words import plural

_NS_PER_S = 1e9


class Times(NamedTuple):
    """The clocks of one message (ns); None where its stamp was not read."""

    log_ns: int
    publish_ns: int
    stamp_ns: int | None = None


Timeline = Mapping[str, Sequence[Times]]
"""By topic, in the order of log time."""


def judged(limit: Range | None, place: str, value: float, text: str) -> Iterator[Finding]:
    """Yield a finding where a value is outside a range; `text` says what the value is."""
    if limit is not None and not limit.holds(value):
        yield Finding(limit.severity, place, f"{text} (allowed: {limit})")


def timing(topic: str, expected: TopicContract, timeline: Timeline, camera: str) -> Iterator[Finding]:
    """Compare the times of a topic's messages with what is expected; `camera` is what its name was made for."""
    times_ns = _logged(timeline, topic)
    yield from judged(expected.messages, f"{topic}: messages", len(times_ns), f"has {plural(len(times_ns), 'message')}")
    if expected.missing_beside is not None:
        other = topic_beside(expected.missing_beside.topic, camera)
        wanted = set(_logged(timeline, other))
        count = len(wanted - set(times_ns))
        missing = "missing (`semgrid-eval segment` adds it)" if topic == camera_topic(camera, LABEL) else "missing"
        text = f"is {missing} for {count} of {len(wanted)} messages of {other}"
        yield from judged(expected.missing_beside, f"{topic}: missing_beside", count, text)
    yield from _steps(topic, expected, times_ns)


def coverage(topic: str, expected: TopicContract, timeline: Timeline, cameras: Cameras) -> Iterator[Finding]:
    """Look for times of other topics before the first message of a topic or after its last."""
    times_ns, limit = _logged(timeline, topic), expected.uncovered_s
    if limit is None or not times_ns:
        return
    for other in topics_of(limit.topic, cameras).values():
        others_ns = _logged(timeline, other)
        if others_ns:
            outside_s = max(times_ns[0] - others_ns[0], others_ns[-1] - times_ns[-1], 0) / _NS_PER_S
            text = f"leaves out {outside_s:.3f} s of the time of {other}"
            yield from judged(limit, f"{topic}: uncovered_s", outside_s, text)


def latencies(contract: Contract, timeline: Timeline, cameras: Cameras) -> Iterator[Finding]:
    """Compare how long after something messages come with what is expected."""
    for expected in contract.latencies:
        for camera, topic in topics_of(expected.topic, cameras).items():
            yield from _latency(expected, topic, _after(expected, camera), timeline)


def _after(expected: Latency, camera: str) -> str | None:
    return None if expected.after is None else topic_beside(expected.after, camera)


def _latency(expected: Latency, topic: str, after: str | None, timeline: Timeline) -> Iterator[Finding]:
    delays_s = _delays_s(expected, timeline.get(topic, ()), None if after is None else timeline.get(after, ()))
    outside = [delay_s for delay_s in delays_s if not expected.seconds.holds(delay_s)]
    if outside:
        worst_s = max(outside, key=abs)
        what = f"{after}: {expected.after_clock}" if after else expected.after_clock
        shown = f"up to {worst_s:g} s after {what}" if worst_s < float("inf") else f"before any {what}"
        text = f"{expected.clock} is {shown} in {len(outside)} of {len(delays_s)} messages"
        yield from judged(expected.seconds, f"{topic}: latency", worst_s, text)


def _delays_s(expected: Latency, messages: Sequence[Times], others: Sequence[Times] | None) -> list[float]:
    """Return how long each message comes after what it is compared with; infinity where there is nothing before it."""
    ends_ns = [(each, end_ns) for each in messages if (end_ns := _clock(each, expected.clock)) is not None]
    if others is None:
        own = ((end_ns, _clock(each, expected.after_clock)) for each, end_ns in ends_ns)
        return [(end_ns - start_ns) / _NS_PER_S for end_ns, start_ns in own if start_ns is not None]
    starts_ns = sorted(time for each in others if (time := _clock(each, expected.after_clock)) is not None)
    found = [(end_ns, bisect_right(starts_ns, end_ns)) for _, end_ns in ends_ns]
    return [(end_ns - starts_ns[place - 1]) / _NS_PER_S if place else float("inf") for end_ns, place in found]


def _clock(times: Times, clock: Clock) -> int | None:
    return {"log": times.log_ns, "publish": times.publish_ns, "stamp": times.stamp_ns}[clock]


def _logged(timeline: Timeline, topic: str) -> list[int]:
    return [each.log_ns for each in timeline.get(topic, ())]


def _steps(topic: str, expected: TopicContract, times_ns: Sequence[int]) -> Iterator[Finding]:
    """Judge repeated times, rate, gaps and jitter; the median step is the period."""
    steps_ns = [after - before for before, after in pairwise(times_ns)]
    if not steps_ns:
        return
    repeated = steps_ns.count(0)
    text = f"has {plural(repeated, 'message')} with the time of the message before"
    wrong = list(judged(expected.repeated_times, f"{topic}: repeated_times", repeated, text))
    yield from wrong
    period_ns = median(steps_ns)
    if wrong or not period_ns:
        return
    yield from judged(expected.rate_hz, f"{topic}: rate_hz", _NS_PER_S / period_ns, f"is {_NS_PER_S / period_ns:g} Hz")
    longest_ns = max(steps_ns)
    text = f"has a gap of {longest_ns / _NS_PER_S:.3f} s at a period of {period_ns / _NS_PER_S:.3f} s"
    yield from judged(expected.gap_s, f"{topic}: gap_s", longest_ns / _NS_PER_S, text)
    yield from judged(expected.gap_periods, f"{topic}: gap_periods", longest_ns / period_ns, text)
    lower_ns, _, upper_ns = quantiles(steps_ns * 2, n=4)  # twice, since quantiles of a single step are undefined
    jitter = (upper_ns - lower_ns) / period_ns
    text = f"has steps in time that vary by {100 * jitter:.0f} % of a period (their middle half)"
    yield from judged(expected.jitter_periods, f"{topic}: jitter_periods", jitter, text)
