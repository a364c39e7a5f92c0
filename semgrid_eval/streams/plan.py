"""What a stream needs of each recording: the answers that are used, as windows, and at which time each is used."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.files import DIGEST_CHARACTERS
from semgrid_eval.streams.config import StreamConfig
from semgrid_eval.streams.leads import Drive, times_asked
from semgrid_eval.streams.schedule import NONE, Answers, Recorded, Times, many_workers, newest_at, one_worker
from semgrid_eval.windows.data import Targets, WindowSet, windows_at
from semgrid_eval.windows.grids import GridData
from semgrid_eval.windows.lead import frames_of
from semgrid_eval.windows.plan import WindowConfig
from semgrid_eval.words import plural

BLOCK_S = 0.5
"""Length of what is counted together; the warm-up is rounded up to whole blocks."""


Latencies = Callable[[str, int], Times]
"""How long the work on each frame of a recording takes: by its name and number of frames, (F,) ns."""
RecordedOf = Callable[[str], Recorded]
"""The answers of a recording in a log of predictions, by its name."""


@dataclass(frozen=True)
class StreamPlan:
    """E times of evaluation with the answers used there, and these as windows of K answers; frames lie along F."""

    answers: WindowSet  # (K) what the model is asked, in the order of recordings and of their use
    numbers: NDArray[np.int64]  # (K,) place of each among all answers that its recording has
    target_m: NDArray[np.float64]  # (K, 2) position of the vehicle at the time that each answer is for
    for_ns: Times  # (K,)
    capture_ns: Times  # (K,) of the newest input
    begin_ns: Times  # (K,) of the work
    publish_ns: Times  # (K,)
    evaluated: NDArray[np.int64]  # (E,) frames
    used: NDArray[np.int64]  # (E,) the answer, or `NONE`
    first_answer_ns: Times  # (R,) from each recording's first frame to its first answer; that to its end where none is
    took_ns: Times  # (A,) from begin to publication of all answers, with those that are never used

    def blocks(self) -> NDArray[np.int64]:
        """Number the block that each evaluation is counted in: (E,) from 0, recording by recording."""
        data = self.answers.data
        owners, _ = data.locate(self.evaluated)
        age_ns = data.stamps_ns[self.evaluated] - data.stamps_ns[data.first_frames[owners]]
        keys = owners * (1 << 32) + age_ns // int(BLOCK_S * 1e9)
        return np.unique(keys, return_inverse=True)[1]

    def digest(self) -> str:
        """Digest what determines every number, given how logs become grids and the model."""
        total = hashlib.sha256(self.answers.digest().encode())
        for part in (self.for_ns, self.capture_ns, self.begin_ns, self.publish_ns, self.evaluated, self.used):
            total.update(repr(part.shape).encode() + part.tobytes())
        return total.hexdigest()[:DIGEST_CHARACTERS]


def plan_stream(
    data: GridData,
    recordings: Sequence[int],
    config: StreamConfig,
    window: WindowConfig,
    latencies: Latencies,
    *,
    sensors: Sequence[str],
    translate: bool = True,
    limits_ns: tuple[int, int] = (0, 1 << 62),
    recorded: RecordedOf | None = None,
) -> StreamPlan:
    """Plan the stream of some recordings.

    Args:
        data: the grids.
        recordings: indices of recordings.
        config: how answers come.
        window: inputs and their step; its horizon is the lead of what is `fixed`.
        latencies: of the whole chain.
        sensors: of the inputs.
        translate: whether inputs are moved to where the vehicle is at the time that an answer is for.
        limits_ns: the shortest and the longest lead that the model can be asked for.
        recorded: answers that lie in logs; then nothing is simulated, and a model is shown what there was by then.

    Raises:
        InputError: no recording has a frame with all its inputs before it.
    """
    how = _How(config, window, latencies, limits_ns, recorded)
    found = [_Part(data, index, how) for index in recordings]
    parts = [part for part in found if len(part.evaluated)]
    if not any(len(part.answers.frame) for part in parts):
        reach = window.span_frames + 1
        raise InputError(f"no recording has the {plural(reach, 'frame')} that the inputs of one answer need")
    counts = np.cumsum([0, *(len(part.kept) for part in parts)])
    used = [np.where(part.used == NONE, NONE, part.used + start) for part, start in zip(parts, counts, strict=False)]
    columns = [np.concatenate(column) for column in zip(*(part.columns() for part in parts), strict=True)]
    frames, target_frames, target_m, for_ns, capture_ns, begin_ns, publish_ns, numbers = columns
    offsets = np.arange(-window.span_frames, 1, window.step_frames)
    first_frames = data.first_frames[data.locate(frames)[0]]  # which only recorded answers can reach back before
    inputs = np.maximum(frames[:, None] + offsets, first_frames[:, None])
    at = Targets(target_frames, target_m, for_ns)
    answers = windows_at(data, inputs, at, sensors=sensors, translate=translate)
    return StreamPlan(
        answers=answers,
        numbers=numbers,
        target_m=target_m,
        for_ns=for_ns,
        capture_ns=capture_ns,
        begin_ns=begin_ns,
        publish_ns=publish_ns,
        evaluated=np.concatenate([part.evaluated for part in parts]),
        used=np.concatenate(used),
        first_answer_ns=np.array([part.first_answer_ns for part in parts], np.int64),
        took_ns=np.concatenate([part.answers.publish_ns - part.answers.begin_ns for part in parts]),
    )


@dataclass(frozen=True)
class _How:
    """Where answers come from, as `plan_stream` is told."""

    config: StreamConfig
    window: WindowConfig
    latencies: Latencies
    limits_ns: tuple[int, int]
    recorded: RecordedOf | None

    def answers(self, name: str, stamps_ns: Times) -> Answers:
        """Simulate the answers of a recording."""
        took_ns, first = self.latencies(name, len(stamps_ns)), self.window.span_frames
        if self.config.workers == "many":
            return many_workers(stamps_ns, took_ns, first)
        return one_worker(stamps_ns, took_ns, first, self.config.rule)


class _Part:
    """The stream of one recording; of its answers, those that are used."""

    def __init__(self, data: GridData, index: int, how: _How) -> None:
        config, self._begin = how.config, int(data.first_frames[index])
        own = slice(self._begin, int(data.first_frames[index + 1]))
        self._stamps_ns, self._position_m = data.stamps_ns[own], data.position_m[own]
        name = data.recordings[index]
        recorded = how.recorded(name) if how.recorded else None
        self.answers = recorded.answers(self._stamps_ns) if recorded else how.answers(name, self._stamps_ns)
        self._capture_ns = recorded.capture_ns if recorded else self._stamps_ns[self.answers.frame]
        local = evaluated_frames(self._stamps_ns, config.rate_hz)
        evaluated_ns = self._stamps_ns[local]
        told_ns = recorded.for_ns if recorded else None
        used = newest_at(evaluated_ns, self._capture_ns, self.answers.publish_ns, told_ns)
        window = how.window
        lead = window.lead_frames if window.lead_ms is None else frames_of(window.lead_ms, self._stamps_ns)
        drive = Drive(self._stamps_ns, evaluated_ns, used, lead, config.workers == "one")
        for_ns = times_asked(config.asked, self.answers, drive, how.limits_ns) if told_ns is None else told_ns
        answered = self.answers.publish_ns.min(initial=int(self._stamps_ns[-1]))
        self.first_answer_ns = int(answered) - int(self._stamps_ns[0])
        if config.asked == "exact":  # each use is an answer of its own
            self.kept, self.used = used[used >= 0], np.where(used >= 0, np.cumsum(used >= 0) - 1, NONE)
            self._for_ns = evaluated_ns[used >= 0]
        else:
            chosen, firsts, places = np.unique(used[used >= 0], return_index=True, return_inverse=True)
            order = np.argsort(firsts)  # of their use: those of a log may be published in another one
            self.kept, self.used = chosen[order], np.full(len(used), NONE)
            self.used[used >= 0] = np.argsort(order)[places]
            self._for_ns = for_ns[self.kept]
        self.evaluated = local + self._begin

    def columns(self) -> Iterator[NDArray[np.int64] | NDArray[np.float64]]:
        """Return of the used answers: frame and target frame along F, position, all times in their order, number."""
        stamps_ns, kept = self._stamps_ns, self.kept
        yield self.answers.frame[kept] + self._begin
        yield np.clip(np.searchsorted(stamps_ns, self._for_ns), 0, len(stamps_ns) - 1) + self._begin
        yield positions_at(self._for_ns, stamps_ns, self._position_m)
        yield self._for_ns
        yield self._capture_ns[kept]
        yield self.answers.begin_ns[kept]
        yield self.answers.publish_ns[kept]
        yield kept


def evaluated_frames(stamps_ns: Times, rate_hz: float | None) -> NDArray[np.int64]:
    """Choose the frames at whose captures a stream is evaluated: every one, or those that come first in each period."""
    if rate_hz is None or not len(stamps_ns):
        return np.arange(len(stamps_ns))
    turn = ((stamps_ns - stamps_ns[0]) * rate_hz * 1e-9).astype(np.int64)
    return np.unique(turn, return_index=True)[1].astype(np.int64)


def positions_at(times_ns: Times, stamps_ns: Times, position_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate the vehicle's position (N, 2) at times (N,); after the last frame it goes on as between the last two.

    At a frame's own time it is exactly that frame's.
    """
    if len(stamps_ns) < 2:
        return np.broadcast_to(position_m[0], (len(times_ns), 2)).copy()
    after = np.clip(np.searchsorted(stamps_ns, times_ns, side="right"), 1, len(stamps_ns) - 1)
    before = after - 1
    share = (times_ns - stamps_ns[before]) / (stamps_ns[after] - stamps_ns[before])
    found: NDArray[np.float64] = position_m[before] + share[:, None] * (position_m[after] - position_m[before])
    exact = np.flatnonzero(np.isin(times_ns, stamps_ns))
    found[exact] = position_m[np.searchsorted(stamps_ns, times_ns[exact])]
    return found
