"""`convert ros2 --inspect`: the topics of a bag, with rates and offsets, and a first map file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.bag import Arrival, Bag
from semgrid_eval.sources.ros2.cameras import Info
from semgrid_eval.sources.ros2.draft import draft_map
from semgrid_eval.sources.ros2.pictures import Shape, ids_of, require_coding, shape_of
from semgrid_eval.sources.ros2.scan import frame_of, stamp_of
from semgrid_eval.sources.ros2.transforms import Transforms

_LOOKED_AT_NS = 20_000_000_000  # of a bag, from its beginning
_NS_PER_S, _NS_PER_MS = 1e9, 1e6


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
    fault: str = ""  # why the first picture cannot be read

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


def inspect_bags(paths: Sequence[Path], map_file: Path) -> str:
    """Describe bags, and write a first map of the first one.

    Raises:
        InputError: a bag cannot be read, or there is a map file already.
    """
    if map_file.exists():
        raise InputError("is there already; name another file with --map", path=map_file, field="map")
    texts, first = [], None
    for path in paths:
        contents = look_at(path)
        first = first or contents
        texts.append(f"{path}\n{_table(contents)}")
    assert first is not None
    with atomic_file(map_file) as stream:
        stream.write(draft_map(first).encode())
    texts.append(f"{map_file} is a first map: read it, then: semgrid-eval convert ros2 BAG... OUT --map {map_file}")
    return "\n\n".join(texts)


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
    if seen.kind not in (*kinds.PICTURES, kinds.DISPARITY):
        return
    try:
        seen.shape = shape_of(message.image if seen.kind == kinds.DISPARITY else message)
    except InputError as error:
        seen.fault = str(error)
        return
    seen.highest_id = _highest_id(seen, message)


def _highest_id(seen: Seen, message: Any) -> int | None:  # noqa: ANN401
    assert seen.shape is not None
    try:
        require_coding("labels", seen.shape.coding)
        ids = ids_of(message)
    except InputError:
        return None
    return int(np.max(ids, where=ids < 255, initial=0))


def _table(contents: Contents) -> str:
    """Return a line for each topic: type, messages, rate, how late they were recorded, and what else is to say."""
    head = ("topic", "type", "messages", "Hz", "late ms", "")
    rows = [head, *(_row(name, seen) for name, seen in contents.topics.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)


def _row(name: str, seen: Seen) -> tuple[str, ...]:
    rate = "-" if seen.rate_hz is None else f"{seen.rate_hz:.4g}"
    late = f"{median(seen.late_ns) / _NS_PER_MS:.1f}" if seen.late_ns and any(seen.stamps_ns) else "-"
    return name, seen.kind, str(seen.count), rate, late, _note(seen)


def _note(seen: Seen) -> str:
    if seen.kind == kinds.POINTS:
        return "not used yet"
    if seen.kind not in (*kinds.STAMPED, kinds.TRANSFORMS):
        return "not used"
    if seen.stamps_ns and not any(seen.stamps_ns):
        return "header stamps are all zero"
    return seen.fault or ("" if seen.shape is None else str(seen.shape))
