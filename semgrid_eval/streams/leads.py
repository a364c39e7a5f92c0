"""The time that each answer of a stream is for, by what is asked of it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.streams.config import Asked
from semgrid_eval.streams.schedule import Answers, Times
from semgrid_eval.windows.lead import period_ns

REMEMBERED = 10
"""Past answers by which a chain expects the latency and the spacing of the next ones."""


class Drive(NamedTuple):
    """What decides for when answers are: captures (F,), times of evaluation (E,), the newest answer at each (E,)."""

    captures_ns: Times
    evaluated_ns: Times
    used: NDArray[np.int64]
    lead_frames: int  # of a network with a fixed lead
    one_worker: bool = True  # who begins with no frame before the last one is done


def times_asked(asked: Asked, answers: Answers, drive: Drive, limits_ns: tuple[int, int]) -> Times:
    """Say for which time each answer is: (K,) ns.

    `limits_ns` are the shortest and the longest time from the newest input to it that a model can be asked for; they
    do not hold for what is not asked: the capture, and a fixed lead.
    """
    found, capture_ns = _RULES[asked](answers, drive), drive.captures_ns[answers.frame]
    if asked in ("capture", "fixed"):
        return found
    return np.clip(found, capture_ns + limits_ns[0], capture_ns + limits_ns[1])


def _captures(answers: Answers, drive: Drive) -> Times:
    return drive.captures_ns[answers.frame]


def _fixed(answers: Answers, drive: Drive) -> Times:
    """So many frames later, as if the last frames' spacing went on where the recording ends."""
    last = len(drive.captures_ns) - 1
    ahead = answers.frame + drive.lead_frames
    beyond = np.maximum(ahead - last, 0) * period_ns(drive.captures_ns)
    return np.asarray(drive.captures_ns[np.minimum(ahead, last)] + beyond)


def _known(answers: Answers, drive: Drive) -> Times:
    """In the middle of the times of evaluation at which the answer is the newest."""
    found = answers.publish_ns.copy()
    for number in np.unique(drive.used[drive.used >= 0]):
        times = drive.evaluated_ns[drive.used == number]
        found[number] = times[(len(times) - 1) // 2]
    return found


def _adaptive(answers: Answers, drive: Drive) -> Times:
    """When the answer will be there, and half the time until the next one is, as the last answers before it tell.

    The first answers, which have none before them, expect what the first one will take.
    """
    order = np.argsort(answers.publish_ns, kind="stable")
    published, took = answers.publish_ns[order], (answers.publish_ns - answers.begin_ns)[order]
    spacing = period_ns(drive.captures_ns)
    found = np.empty_like(answers.begin_ns)
    for number, begin_ns in enumerate(answers.begin_ns):
        known = int(np.searchsorted(published, begin_ns, side="right"))
        seen = slice(max(0, known - REMEMBERED), known)
        latency = int(took[seen].mean()) if known else int(took[0])
        usual = max(spacing, latency) if drive.one_worker else spacing
        between = int(np.diff(published[seen]).mean()) if known > 1 else usual
        found[number] = begin_ns + latency + between // 2
    return found


_RULES: dict[Asked, Callable[[Answers, Drive], Times]] = {
    "capture": _captures,
    "fixed": _fixed,
    "known": _known,
    "exact": _known,
    "adaptive": _adaptive,
}
