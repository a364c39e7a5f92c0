"""One stretch of a bag as a recording: the second pass, over its own part of the bag."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_value
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.types import CameraFrame, Moment, MotionSample, Recording
from semgrid_eval.sources.ros2.bag import Arrival, Bag
from semgrid_eval.sources.ros2.frames import CLOUD, FramePlan, Piece
from semgrid_eval.sources.ros2.lidars import LONGEST_NS, LidarPlan, Sweeps
from semgrid_eval.sources.ros2.rig import Rig, RigPlan
from semgrid_eval.sources.ros2.scan import stamp_of

DATASET = "ros2"
AROUND_NS = int(LONGEST_NS)
"""How much of the motion before and after a stretch is kept: points of its sweeps may be of those times."""
_CONVERSION_VERSION = 2  # to be raised when the same bag gives another recording


@dataclass(frozen=True)
class Stretch:
    """What a recording is made of; it travels to another process."""

    bag: Path
    name: str
    split: str
    group: str
    clock: str  # of the stamps: header or received
    kinds: dict[str, str]  # message types by topic
    rigs: dict[str, RigPlan]  # by camera
    lidars: dict[str, LidarPlan]
    frames: tuple[FramePlan, ...]  # in the order of time
    motion: tuple[MotionSample, ...]  # from before the first frame to after the last one

    def digest(self) -> str:
        """Digest what determines the content; messages with pictures and points count by their digests."""
        rigs = {name: rig.described() for name, rig in self.rigs.items()}
        lidars = {name: lidar.described() for name, lidar in self.lidars.items()}
        frames = [frame.described() for frame in self.frames]
        motion = [[each.stamp_ns, each.speed_mps, each.yaw_rate_radps] for each in self.motion]
        return digest_value([_CONVERSION_VERSION, self.name, self.split, self.group, rigs, lidars, frames, motion])

    def recording(self) -> Recording:
        """Return the recording, which reads the bag while it is streamed."""
        return Recording(
            name=self.name,
            dataset=DATASET,
            split=self.split,
            group=self.group,
            calibrations={name: rig.calibration for name, rig in self.rigs.items()},
            source_digest=self.digest(),
            moments=partial(moments, self),
        )


def moments(stretch: Stretch) -> Iterator[Moment]:
    """Read the messages of a stretch and make its moments; only messages that wait for others are in memory.

    Raises:
        InputError: the bag is not what it was in the first pass, or a picture or cloud is damaged.
    """
    makers = _Makers(stretch)
    coming = deque(stretch.motion)
    while len(coming) > 1 and coming[1].stamp_ns <= stretch.frames[0].stamp_ns:
        coming.popleft()
    for stamp_ns, frames in groupby(_gathered(stretch), key=lambda each: each[0].stamp_ns):
        cameras, sweeps = makers.made(frames)
        yield Moment(stamp_ns, cameras, tuple(_until(stamp_ns, coming)), sweeps=sweeps)
    if coming and stretch.frames[-1].stamp_ns not in {each.stamp_ns for each in stretch.motion}:
        yield Moment(coming[0].stamp_ns, {}, (coming[0],))  # motion covers all frames


class _Makers:
    """What makes frames and sweeps of a stretch's messages."""

    def __init__(self, stretch: Stretch) -> None:
        self._bag = stretch.bag
        motion = EgoMotion(stretch.motion, "arc")
        self._rigs = {name: Rig(plan) for name, plan in stretch.rigs.items()}
        self._sweeps = {name: Sweeps(plan, motion) for name, plan in stretch.lidars.items()}

    def made(
        self, frames: Iterable[tuple[FramePlan, dict[str, Any]]]
    ) -> tuple[dict[str, CameraFrame], dict[str, LidarSweep]]:
        """Make what cameras and LiDARs saw at one time, by their names."""
        cameras, sweeps = {}, {}
        for plan, messages in frames:
            with located(path=self._bag, field=f"{plan.sensor} at {plan.stamp_ns} ns"):
                if plan.sensor in self._rigs:
                    cameras[plan.sensor] = self._rigs[plan.sensor].frame(plan.stamp_ns, messages)
                else:
                    sweeps[plan.sensor] = self._sweeps[plan.sensor].sweep(plan.stamp_ns, messages[CLOUD])
        return cameras, sweeps


def _until(stamp_ns: int, coming: deque[MotionSample]) -> Iterator[MotionSample]:
    while coming and coming[0].stamp_ns <= stamp_ns:
        yield coming.popleft()


def _gathered(stretch: Stretch) -> Iterator[tuple[FramePlan, dict[str, Any]]]:
    """Iterate over frames in their order, each with its messages."""
    needed = Counter(_key(piece) for frame in stretch.frames for piece in frame.pieces.values())
    waiting: dict[tuple[str, int], Any] = {}
    remaining = iter(stretch.frames)
    frame = next(remaining, None)
    with Bag(stretch.bag) as bag:
        for key, message in _messages(stretch, bag, needed):
            waiting.setdefault(key, message)
            while frame is not None and all(_key(piece) in waiting for piece in frame.pieces.values()):
                yield frame, {what: waiting[_key(piece)] for what, piece in frame.pieces.items()}
                for piece in frame.pieces.values():
                    _release(_key(piece), needed, waiting)
                frame = next(remaining, None)
    if frame is not None:
        raise InputError(f"no longer holds the frame at {frame.stamp_ns} ns", path=stretch.bag)


def _messages(stretch: Stretch, bag: Bag, needed: Counter[tuple[str, int]]) -> Iterator[tuple[tuple[str, int], Any]]:
    """Iterate over the messages that are still needed, as they were recorded."""
    pieces = [piece for frame in stretch.frames for piece in frame.pieces.values()]
    span_ns = min(piece.received_ns for piece in pieces), max(piece.received_ns for piece in pieces)
    for arrival in bag.arrivals({piece.topic for piece in pieces}, span_ns):
        message = bag.decode(arrival, stretch.kinds[arrival.topic])
        key = arrival.topic, _stamp(stretch, arrival, message)
        if needed[key] > 0:
            yield key, message


def _stamp(stretch: Stretch, arrival: Arrival, message: Any) -> int:  # noqa: ANN401
    return stamp_of(message) if stretch.clock == "header" else arrival.received_ns


def _key(piece: Piece) -> tuple[str, int]:
    return piece.topic, piece.stamp_ns


def _release(key: tuple[str, int], needed: Counter[tuple[str, int]], waiting: dict[tuple[str, int], Any]) -> None:
    needed[key] -= 1
    if not needed[key]:
        del waiting[key]
