"""One stretch of a bag as a recording: the second pass, over its own part of the bag."""

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_value
from semgrid_eval.recording.types import CameraFrame, Moment, MotionSample, Recording
from semgrid_eval.sources.ros2.bag import Arrival, Bag
from semgrid_eval.sources.ros2.frames import FramePlan, Piece
from semgrid_eval.sources.ros2.rig import Rig, RigPlan
from semgrid_eval.sources.ros2.scan import stamp_of

DATASET = "ros2"
_CONVERSION_VERSION = 1  # to be raised when the same bag gives another recording


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
    frames: tuple[FramePlan, ...]  # in the order of time
    motion: tuple[MotionSample, ...]

    def digest(self) -> str:
        """Digest what determines the content; pictures count by the digests of their messages."""
        rigs = {name: rig.described() for name, rig in self.rigs.items()}
        frames = [frame.described() for frame in self.frames]
        motion = [[each.stamp_ns, each.speed_mps, each.yaw_rate_radps] for each in self.motion]
        return digest_value([_CONVERSION_VERSION, self.name, self.split, self.group, rigs, frames, motion])

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
    """Read the pictures of a stretch and make its moments; only messages that wait for others are in memory.

    Raises:
        InputError: the bag is not what it was in the first pass, or a picture is damaged.
    """
    rigs = {name: Rig(plan) for name, plan in stretch.rigs.items()}
    coming = deque(stretch.motion)
    for stamp_ns, frames in groupby(_gathered(stretch), key=lambda each: each[0].stamp_ns):
        cameras = {plan.camera: _made(stretch, rigs[plan.camera], plan, found) for plan, found in frames}
        yield Moment(stamp_ns, cameras, tuple(_until(stamp_ns, coming)))


def _until(stamp_ns: int, coming: deque[MotionSample]) -> Iterator[MotionSample]:
    while coming and coming[0].stamp_ns <= stamp_ns:
        yield coming.popleft()


def _made(stretch: Stretch, rig: Rig, plan: FramePlan, messages: dict[str, Any]) -> CameraFrame:
    with located(path=stretch.bag, field=f"{plan.camera} at {plan.stamp_ns} ns"):
        return rig.frame(plan.stamp_ns, messages)


def _gathered(stretch: Stretch) -> Iterator[tuple[FramePlan, dict[str, Any]]]:
    """Iterate over frames in their order, each with the messages of its pictures."""
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
