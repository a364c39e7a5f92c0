"""What the first messages of a bag tell of its topics."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.bag import Arrival, Bag
from semgrid_eval.sources.ros2.cameras import Info
from semgrid_eval.sources.ros2.clouds_seen import CloudSeen, look_at_cloud
from semgrid_eval.sources.ros2.pictures import Shape, ids_of, require_coding, shape_of
from semgrid_eval.sources.ros2.scan import frame_of, stamp_of
from semgrid_eval.sources.ros2.transforms import Transforms

_LOOKED_AT_NS = 20_000_000_000  # of a bag, from its beginning
_NS_PER_S = 1e9


@dataclass
class Seen:
    """What the first messages of a topic tell."""

    kind: str
    count: int  # of messages in the whole bag
    stamps_ns: list[int] = field(default_factory=list)
    late_ns: list[int] = field(default_factory=list)  # how long after its stamp a message was recorded
    frame: str = ""  # of the first message
    child: str = ""  # of an Odometry, the frame whose motion it is
    shape: Shape | None = None  # of a picture
    info: Info | None = None
    highest_id: int | None = None  # in the first picture, if it can hold ids; 255 does not count
    cloud: CloudSeen | None = None
    fault: str = ""  # why the first picture or cloud cannot be read

    @property
    def rate_hz(self) -> float | None:
        """How often messages come; None where too few were seen."""
        span_ns = max(self.stamps_ns) - min(self.stamps_ns) if self.stamps_ns else 0
        return (len(self.stamps_ns) - 1) * _NS_PER_S / span_ns if span_ns > 0 else None


@dataclass
class Contents:
    """What the beginning of a bag tells."""

    topics: dict[str, Seen]
    transforms: Transforms = field(default_factory=Transforms)

    @property
    def unstamped(self) -> bool:
        """Whether no message has a stamp in its header."""
        stamps_ns = [stamp for seen in self.topics.values() for stamp in seen.stamps_ns]
        return bool(stamps_ns) and not any(stamps_ns)


def look_at(path: Path) -> Contents:
    """Read the first messages of a bag.

    Raises:
        InputError: it is damaged or not a bag.
    """
    with Bag(path) as bag:
        contents = Contents({name: Seen(topic.type, topic.messages) for name, topic in bag.topics().items()})
        start_ns, _ = bag.span_ns
        known = {name for name, seen in contents.topics.items() if seen.kind in (*kinds.STAMPED, kinds.TRANSFORMS)}
        for arrival in bag.arrivals(known, (start_ns, start_ns + _LOOKED_AT_NS)):
            seen = contents.topics[arrival.topic]
            message = bag.decode(arrival, seen.kind)
            if seen.kind == kinds.TRANSFORMS:
                contents.transforms.add(message)
            else:
                _look(seen, arrival, message)
    return contents


def _look(seen: Seen, arrival: Arrival, message: Any) -> None:  # noqa: ANN401 - a class that rosbags makes
    if not seen.stamps_ns:
        _look_closely(seen, message)
    stamp_ns = stamp_of(message)
    seen.stamps_ns.append(stamp_ns)
    seen.late_ns.append(arrival.received_ns - stamp_ns)


def _look_closely(seen: Seen, message: Any) -> None:  # noqa: ANN401
    """Take what the first message of a topic tells."""
    seen.frame = frame_of(message)
    seen.child = str(getattr(message, "child_frame_id", ""))
    if seen.kind == kinds.CAMERA_INFO:
        seen.info = Info.of(message)
    try:
        if seen.kind == kinds.POINTS:
            seen.cloud = look_at_cloud(message)
        elif seen.kind in (*kinds.PICTURES, kinds.DISPARITY):
            seen.shape = shape_of(message.image if seen.kind == kinds.DISPARITY else message)
            seen.highest_id = _highest_id(seen, message)
    except InputError as error:
        seen.fault = str(error)


def _highest_id(seen: Seen, message: Any) -> int | None:  # noqa: ANN401
    assert seen.shape is not None
    try:
        require_coding("labels", seen.shape.coding)
        ids = ids_of(message)
    except InputError:
        return None
    return int(np.max(ids, where=ids < 255, initial=0))
