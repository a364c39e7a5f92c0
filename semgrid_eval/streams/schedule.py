"""When a chain begins and ends its work on frames, and which of its answers is the newest at a time.

All times are whole nanoseconds. The rules are those of streaming perception (Li et al. 2020, "Towards Streaming
Perception"): a worker is busy while it works, what comes meanwhile is skipped.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.streams.config import Rule
from semgrid_eval.windows.lead import period_ns

Times = NDArray[np.int64]
NONE = -1
"""Where there is no answer yet."""


class Answers(NamedTuple):
    """K answers, simulated ones in the order of their captures: the frame (index) of the newest input, times in ns."""

    frame: NDArray[np.int64]
    begin_ns: Times
    publish_ns: Times


class Recorded(NamedTuple):
    """K answers that a log of predictions holds, in its order."""

    capture_ns: Times
    for_ns: Times
    publish_ns: Times

    def answers(self, captures_ns: Times) -> Answers:
        """Find the frames of the newest inputs, by the captures of all frames (F,); work begins with the capture."""
        frames = np.searchsorted(captures_ns, self.capture_ns, side="right") - 1
        return Answers(np.maximum(frames, 0), self.capture_ns, self.publish_ns)


def many_workers(captures_ns: Times, latencies_ns: Times, first: int) -> Answers:
    """Begin with every frame at its capture, from the frame `first` on; both (F,)."""
    frames = np.arange(first, len(captures_ns))
    begin_ns = captures_ns[first:]
    return Answers(frames, begin_ns, begin_ns + latencies_ns[first:])


def one_worker(captures_ns: Times, latencies_ns: Times, first: int, rule: Rule = "newest") -> Answers:
    """Begin with the newest frame when the worker is free, from the frame `first` on; wait where there is none.

    By `shrinking_tail` it also waits for the next frame where beginning at once would leave, in the end, a smaller part
    of a frame's time than has passed since the newest capture: the answer would be based on an older frame for nothing.
    It expects the mean latency of the recording.

    Args:
        captures_ns: (F,) captures of the frames, ascending.
        latencies_ns: (F,) time that the work on each frame takes.
        first: first frame that has all its inputs.
        rule: when to begin.
    """
    count, found = len(captures_ns), list[tuple[int, int, int]]()
    period = max(1, period_ns(captures_ns))
    expected_ns = round(float(latencies_ns.mean())) if count else 0
    free_ns, following = 0, first
    while following < count:
        begin_ns = max(free_ns, int(captures_ns[following]))
        frame = int(np.searchsorted(captures_ns, begin_ns, side="right")) - 1
        if rule == "shrinking_tail" and frame + 1 < count:
            tail_ns = begin_ns - int(captures_ns[frame])
            if (tail_ns + expected_ns) % period < tail_ns % period:
                frame += 1
                begin_ns = int(captures_ns[frame])
        free_ns = begin_ns + int(latencies_ns[frame])
        found.append((frame, begin_ns, free_ns))
        following = frame + 1
    return Answers(*np.array(found, np.int64).reshape(-1, 3).T)


def newest_at(times_ns: Times, capture_ns: Times, publish_ns: Times, for_ns: Times | None = None) -> NDArray[np.int64]:
    """Find the newest answer that is published by each time (E,): -> (E,) indices of K answers, `NONE` where none is.

    Newest is whose newest input was captured last; of those, what is for the latest time, then what was published last.
    Answers may come in any order.
    """
    for_ns = capture_ns if for_ns is None else for_ns
    order = np.lexsort((publish_ns, for_ns, capture_ns))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    by_publication = np.argsort(publish_ns, kind="stable")
    best = np.maximum.accumulate(rank[by_publication]) if len(order) else rank
    published = np.searchsorted(publish_ns[by_publication], times_ns, side="right")
    return np.where(published > 0, order[best[published - 1]], NONE) if len(order) else np.full(len(times_ns), NONE)
