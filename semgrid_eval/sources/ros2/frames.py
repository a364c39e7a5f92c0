"""Which messages make a frame, and which frames make a recording: by stamps alone."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.motion import EXTRAPOLATION_LIMIT_S
from semgrid_eval.sources.parts import count_of_parts, equal_parts
from semgrid_eval.sources.ros2.arrivals import Arrivals
from semgrid_eval.sources.ros2.mapping import CameraMap

_HOLE_PERIODS = 1.5
_LEAST_FRAMES = 2
_NS_PER_S = 1e9
CLOUD = "cloud"
"""What the message of a sweep is."""
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Piece:
    """One message of a frame."""

    topic: str
    stamp_ns: int
    received_ns: int
    digest: int


@dataclass(frozen=True)
class FramePlan:
    """One frame of a camera with its pictures, by what they are, or one sweep of a LiDAR with its `cloud`."""

    sensor: str
    stamp_ns: int
    pieces: dict[str, Piece]

    def described(self) -> list[Any]:
        """Return as JSON what determines the frame: its messages count by their digests."""
        return [self.sensor, self.stamp_ns, {what: piece.digest for what, piece in self.pieces.items()}]


def frames_of(
    name: str, camera: CameraMap, arrivals: Mapping[str, Arrivals], tolerance_s: float, lost: Counter[str]
) -> list[FramePlan]:
    """Return the frames of a camera that have all pictures that the map names; `lost` counts what the others lack.

    Raises:
        InputError: no frame has all.
    """
    base = arrivals[camera.main_topic]
    pictures = camera.pictures()
    places = {what: arrivals[topic].nearest(base.stamps_ns) for what, topic in pictures.items()}
    whole = np.ones(len(base.stamps_ns), np.bool_)
    for what, topic in pictures.items():
        apart_ns = np.abs(arrivals[topic].stamps_ns[places[what]] - base.stamps_ns)
        found = apart_ns <= tolerance_s * _NS_PER_S
        if not found.any():
            nearest_s = apart_ns.min() / _NS_PER_S
            message = f"none is within {tolerance_s:g} s of {camera.main_topic}; the nearest is {nearest_s:.3f} s away"
            raise InputError(f"{message} (tolerance_s in the map)", field=topic)
        lost[f"without {what}"] += int((whole & ~found).sum())
        whole &= found
    kept = np.flatnonzero(whole)
    pieces = ({what: _piece(arrivals[pictures[what]], places[what][at]) for what in pictures} for at in kept)
    return [FramePlan(name, int(base.stamps_ns[at]), each) for at, each in zip(kept, pieces, strict=True)]


def sweeps_of(name: str, arrivals: Arrivals) -> list[FramePlan]:
    """Return the sweeps of a LiDAR: each of its clouds is one."""
    pieces = (_piece(arrivals, at) for at in range(len(arrivals.stamps_ns)))
    return [FramePlan(name, piece.stamp_ns, {CLOUD: piece}) for piece in pieces]


def _piece(arrivals: Arrivals, at: int | np.intp) -> Piece:
    columns = (arrivals.stamps_ns, arrivals.received_ns, arrivals.digests)
    return Piece(arrivals.topic, *(int(each[at]) for each in columns))


def covered(frames: Sequence[FramePlan], motion_ns: Stamps, lost: Counter[str]) -> list[FramePlan]:
    """Return the frames that have motion near, before and after them but at the ends; `lost` counts the others."""
    stamps_ns = _stamps(frames)
    before = np.maximum(np.searchsorted(motion_ns, stamps_ns, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(motion_ns, stamps_ns, side="left"), len(motion_ns) - 1)
    limit_ns = EXTRAPOLATION_LIMIT_S * _NS_PER_S
    near = np.abs(stamps_ns - motion_ns[before]) <= limit_ns
    near &= np.abs(motion_ns[after] - stamps_ns) <= limit_ns
    lost["without motion"] += int((~near).sum())
    return [frame for frame, keep in zip(frames, near, strict=True) if keep]


def stretches(
    by_sensor: Mapping[str, Sequence[FramePlan]], single: Set[str], longest_s: float, lost: Counter[str]
) -> list[tuple[int, list[FramePlan]]]:
    """Cut the frames of all sensors where one of them has a hole, and into parts of at most `longest_s`.

    Windows count frames, so each recording has frames of all sensors, without a hole, but for `single` cameras, of
    which there are no grids: theirs may be missing. Each stretch comes with the number of its first frame, as the first
    sensor that is not single counts them, else all together. `lost` counts the frames of stretches that are too short.
    """
    everything = sorted((each for frames in by_sensor.values() for each in frames), key=_order)
    stamps_ns = _stamps(everything)
    counted = {sensor: _stamps(frames) for sensor, frames in by_sensor.items() if sensor not in single}
    cuts_ns = {cut_ns for each in counted.values() for cut_ns in _holes(each)}
    numbers = next(iter(counted.values()), stamps_ns)
    found = []
    for span_ns in _spans(stamps_ns, cuts_ns, longest_s):
        start, end = np.searchsorted(stamps_ns, span_ns)
        frames = everything[start:end]
        counts = Counter(each.sensor for each in frames)
        needed = [counts[sensor] for sensor in counted] or [len(frames)]
        if min(needed) >= _LEAST_FRAMES:
            found.append((int(np.searchsorted(numbers, frames[0].stamp_ns)), frames))
        else:
            lost["where a sensor has fewer than two"] += len(frames)
    return found


def _stamps(frames: Sequence[FramePlan]) -> Stamps:
    return np.array([frame.stamp_ns for frame in frames], np.int64)


def _spans(stamps_ns: Stamps, cuts_ns: Iterable[int], longest_s: float) -> Iterator[tuple[int, int]]:
    """Iterate over spans (ends exclusive) between cuts, in parts that are not too long."""
    if len(stamps_ns):
        ends_ns = (int(stamps_ns[0]), *sorted(cuts_ns), int(stamps_ns[-1]) + 1)
        for start_ns, end_ns in pairwise(ends_ns):
            yield from equal_parts(start_ns, end_ns, count_of_parts(end_ns - start_ns, longest_s))


def _order(frame: FramePlan) -> tuple[int, str]:
    return frame.stamp_ns, frame.sensor


def _holes(stamps_ns: Stamps) -> list[int]:
    """Return the stamps before which frames are missing."""
    steps_ns = np.diff(stamps_ns)
    if not len(steps_ns):
        return []
    return [int(each) for each in stamps_ns[1:][steps_ns > _HOLE_PERIODS * np.median(steps_ns)]]
