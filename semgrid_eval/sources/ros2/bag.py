"""Read ROS 2 bags, folders or single files of both storages, by `rosbags`; what it raises becomes an InputError."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from semgrid_eval.errors import InputError

_TYPES = get_typestore(Stores.ROS2_HUMBLE)
"""Definitions of the standard messages, which are the same in all ROS 2 releases that write bags of these versions."""
_SHOWN = 200
_CUT_OFF = ("end magic is invalid", "Truncated record", "Invalid MCAP footer", "disk image is malformed")
_ADVICE = "; it was cut off while it was recorded or copied: recover it (mcap recover, sqlite3 .recover) and try again"


class Topic(NamedTuple):
    """What a bag says of a topic."""

    name: str
    type: str  # such as sensor_msgs/msg/Image
    messages: int


class Arrival(NamedTuple):
    """A message as it lies in the bag."""

    topic: str
    received_ns: int  # when it was recorded
    data: bytes


class Bag:
    """An open bag; closes its files with its block.

    Raises:
        InputError: it is not a bag, or it is damaged; what is found only while reading is raised then.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.is_dir() and not (path / "metadata.yaml").exists():
            message = "has no metadata.yaml; name its .mcap or .db3 files instead, or run: ros2 bag reindex"
            raise InputError(message, path=path)
        with _damage_as_input_error(path):
            self._reader = Reader(path)
            self._reader.open()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    @property
    def name(self) -> str:
        """What its recordings are called."""
        path = self.path.resolve()
        return path.name if path.is_dir() else path.stem

    def topics(self) -> dict[str, Topic]:
        """Return all topics by name, sorted.

        Raises:
            InputError: messages of two types were recorded on one topic.
        """
        found: dict[str, Topic] = {}
        for each in sorted(self._reader.connections, key=lambda each: each.topic):
            known = found.get(each.topic, Topic(each.topic, each.msgtype, 0))
            if known.type != each.msgtype:
                raise InputError(f"holds {known.type} and {each.msgtype}", path=self.path, field=each.topic)
            found[each.topic] = known._replace(messages=known.messages + each.msgcount)
        return found

    @property
    def span_ns(self) -> tuple[int, int]:
        """When the first message was recorded, and when the last one."""
        return self._reader.start_time, max(self._reader.end_time - 1, self._reader.start_time)

    def arrivals(self, topics: Collection[str], span_ns: tuple[int, int] | None = None) -> Iterator[Arrival]:
        """Iterate over the messages of some topics as they were recorded, those within a span (ends included)."""
        wanted = [each for each in self._reader.connections if each.topic in topics]
        if not wanted:
            return
        start_ns, stop_ns = (None, None) if span_ns is None else (span_ns[0], span_ns[1] + 1)
        with _damage_as_input_error(self.path):
            messages = self._reader.messages(wanted, start_ns, stop_ns)
        while True:
            with _damage_as_input_error(self.path):
                found = next(messages, None)
            if found is None:
                return
            yield Arrival(found[0].topic, found[1], found[2])

    def decode(self, arrival: Arrival, kind: str) -> Any:  # noqa: ANN401 - a class that rosbags makes
        """Return the message of an arrival of a type, such as sensor_msgs/msg/Image."""
        with _damage_as_input_error(self.path, arrival):
            return _TYPES.deserialize_cdr(arrival.data, kind)


@contextmanager
def _damage_as_input_error(path: Path, arrival: Arrival | None = None) -> Iterator[None]:
    """Turn whatever a damaged bag makes the libraries raise, which have no base of their own, into one line."""
    field = None if arrival is None else f"{arrival.topic} recorded at {arrival.received_ns} ns"
    try:
        yield
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path=path, field=field) from error
    except Exception as error:
        text = " ".join(str(error).split())[:_SHOWN] or type(error).__name__
        advice = _ADVICE if any(sign in text for sign in _CUT_OFF) else ""
        raise InputError(f"is damaged or not a bag: {text}{advice}", path=path, field=field) from error
