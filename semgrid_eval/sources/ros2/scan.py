"""The first pass over a bag: what each mapped topic holds, but for pixels and points, left for the second."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.arrivals import Arrivals, Ledger
from semgrid_eval.sources.ros2.bag import Arrival, Bag
from semgrid_eval.sources.ros2.cameras import Info
from semgrid_eval.sources.ros2.clouds import Extras, columns_of, is_empty, require_layout, times_of
from semgrid_eval.sources.ros2.mapping import BagMap, LidarMap
from semgrid_eval.sources.ros2.motion import Track, values_of
from semgrid_eval.sources.ros2.pictures import Shape, require_coding, shape_of
from semgrid_eval.sources.ros2.transforms import Transforms

_NS_PER_S = 1_000_000_000
_CLOUDS_TIMED = 20


class Use(NamedTuple):
    """A topic, and what the map uses it as: a key of `kinds.ALLOWED`."""

    topic: str
    name: str


class Stereo(NamedTuple):
    """What a DisparityImage says of its cameras, in single precision."""

    f_px: float
    baseline_m: float


@dataclass
class Facts:
    """What a bag holds, by topic."""

    arrivals: dict[str, Arrivals] = field(default_factory=dict)  # of pictures, clouds and motion
    shapes: dict[str, Shape] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)  # the frame that the first message names
    infos: dict[str, Info] = field(default_factory=dict)
    stereo: dict[str, Stereo] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)  # by use: speed, yaw_rate
    kinds: dict[str, str] = field(default_factory=dict)  # message types
    spans: dict[str, list[float]] = field(default_factory=dict)  # of times in each of the first clouds, by LiDAR
    transforms: Transforms = field(default_factory=Transforms)


def uses_of(mapping: BagMap) -> Iterator[Use]:
    """List what the map uses, without tf."""
    yield Use(mapping.motion.speed.topic, "speed")
    yield Use(mapping.motion.turning.topic, "yaw_rate")
    for camera in mapping.cameras.values():
        yield from (Use(topic, name) for name, topic in camera.pictures().items())
        yield Use(camera.info, "info")
        if camera.right_info is not None:
            yield Use(camera.right_info, "right_info")
    yield from (Use(lidar.cloud, "cloud") for lidar in mapping.lidars.values())


def scan(bag: Bag, mapping: BagMap) -> Facts:
    """Read what the map names once, one message in memory at a time.

    Raises:
        InputError: a topic is not there or of another type, its pictures or calibration change, its clock jumps, or
            the bag is damaged.
    """
    wanted = list(uses_of(mapping))
    found = _types(bag, wanted)
    wanted += [Use(topic, "tf") for topic in mapping.vehicle.tf if topic in found]
    for use in wanted:
        _require_type(bag, use, found[use.topic])
    scanner = _Scanner(bag, mapping, wanted, found)
    for arrival in bag.arrivals({use.topic for use in wanted}):
        scanner.take(arrival)
    return scanner.close()


class _Scanner:
    """Collects facts message by message."""

    def __init__(self, bag: Bag, mapping: BagMap, wanted: list[Use], types: dict[str, str]) -> None:
        self._bag, self._mapping = bag, mapping
        self._uses: dict[str, list[str]] = {}
        for use in dict.fromkeys(wanted):
            self._uses.setdefault(use.topic, []).append(use.name)
        self._facts = Facts(kinds={topic: types[topic] for topic in self._uses})
        self._ledgers: dict[str, Ledger] = {}

    def take(self, arrival: Arrival) -> None:
        message = self._bag.decode(arrival, self._facts.kinds[arrival.topic])
        with located(path=self._bag.path):
            self._take(arrival, message)

    def close(self) -> Facts:
        for topic, names in self._uses.items():
            if {"info", "right_info"} & set(names) and topic not in self._facts.infos:
                raise InputError("has no message", path=self._bag.path, field=topic)
            if set(names) <= {"info", "right_info", "tf"}:
                continue
            with located(path=self._bag.path):
                self._facts.arrivals[topic] = self._ledgers.get(topic, Ledger(topic)).close()
        return self._facts

    def _take(self, arrival: Arrival, message: Any) -> None:  # noqa: ANN401 - a class that rosbags makes
        names = self._uses[arrival.topic]
        if names == ["tf"]:
            self._facts.transforms.add(message, self._mapping.vehicle.tf.index(arrival.topic))
            return
        stamp_ns = stamp_of(message) if self._mapping.clock == "header" else arrival.received_ns
        self._facts.frames.setdefault(arrival.topic, frame_of(message))
        if "info" in names or "right_info" in names:
            self._calibration(arrival.topic, Info.of(message), stamp_ns)
            return
        is_motion = names[0] in ("speed", "yaw_rate")
        digest = 0 if is_motion else int.from_bytes(blake2b(arrival.data, digest_size=8).digest(), "big")
        self._ledgers.setdefault(arrival.topic, Ledger(arrival.topic)).add(stamp_ns, arrival.received_ns, digest)
        for name in names:
            if is_motion:
                self._motion(arrival.topic, name, stamp_ns, message)
            elif name == "cloud":
                self._cloud(arrival.topic, stamp_ns, message)
            else:
                self._picture(arrival.topic, name, stamp_ns, message)

    def _calibration(self, topic: str, info: Info, stamp_ns: int) -> None:
        if self._facts.infos.setdefault(topic, info) != info:
            raise InputError(f"changes at {stamp_ns} ns; a recording has one calibration", field=topic)

    def _motion(self, topic: str, name: str, stamp_ns: int, message: Any) -> None:  # noqa: ANN401
        motion = self._mapping.motion
        by = motion.speed.by if name == "speed" else motion.turning.by
        track = self._facts.tracks.setdefault(name, Track(topic))
        track.stamps_ns.append(stamp_ns)
        track.values.append(values_of(message, self._facts.kinds[topic], by))

    def _picture(self, topic: str, name: str, stamp_ns: int, message: Any) -> None:  # noqa: ANN401
        with located(field=f"{topic} at {stamp_ns} ns"):
            shape = shape_of(message.image if name == "disparity" else message)
            require_coding(name, shape.coding)
        first = self._facts.shapes.setdefault(topic, shape)
        if shape != first:
            raise InputError(f"begins as {first} and is {shape} at {stamp_ns} ns", field=topic)
        if name == "disparity":
            stereo = Stereo(float(message.f), abs(float(message.t)))
            if self._facts.stereo.setdefault(topic, stereo) != stereo:
                raise InputError(f"changes f or t at {stamp_ns} ns; a recording has one calibration", field=topic)

    def _cloud(self, topic: str, stamp_ns: int, message: Any) -> None:  # noqa: ANN401
        with located(field=f"{topic} at {stamp_ns} ns"):
            for name, lidar in self._mapping.lidars.items():
                if lidar.cloud == topic and not is_empty(message):
                    require_layout(message, Extras.of(lidar))
                    self._span(name, lidar, message)

    def _span(self, name: str, lidar: LidarMap, message: Any) -> None:  # noqa: ANN401
        spans = self._facts.spans.setdefault(name, [])
        if lidar.times is None or len(spans) == _CLOUDS_TIMED:
            return
        values = times_of(columns_of(message, Extras.of(lidar)), lidar.times.field)
        if len(values):
            spans.append(float(np.ptp(values)))


def stamp_of(message: Any) -> int:  # noqa: ANN401
    """Return the stamp in a message's header (ns)."""
    stamp = message.header.stamp
    return int(stamp.sec) * _NS_PER_S + int(stamp.nanosec)


def frame_of(message: Any) -> str:  # noqa: ANN401
    """Return the frame that a message's header names."""
    return str(message.header.frame_id)


def _types(bag: Bag, wanted: list[Use]) -> dict[str, str]:
    """Return the types of all topics; those that are wanted must be among them."""
    found = {name: topic.type for name, topic in bag.topics().items()}
    for use in wanted:
        if use.topic not in found:
            known = ", ".join(f"{name} ({kind})" for name, kind in found.items()) or "nothing"
            raise InputError(f"is not in the bag, which holds: {known}", path=bag.path, field=use.topic)
    return found


def _require_type(bag: Bag, use: Use, kind: str) -> None:
    if kind not in kinds.ALLOWED[use.name]:
        allowed = " or ".join(kinds.ALLOWED[use.name])
        raise InputError(f"is {kind}; {use.name} is read from {allowed}", path=bag.path, field=use.topic)
