"""What the first cloud of a topic tells: its fields, and which of them look like times and labels."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.labels import LAST_LABEL_ID
from semgrid_eval.sources.kitti.labels import CLASSES, classes_of
from semgrid_eval.sources.ros2.clouds import NUMBERS, WHOLE, Extras, columns_of, times_of, type_of
from semgrid_eval.sources.ros2.labels import likely_ids
from semgrid_eval.sources.ros2.lidars import LONGEST_NS, NS_BY_UNIT, unit_that_fills
from semgrid_eval.sources.ros2.mapping import PointTimes

_TIME_NAMES = ("t", "time", "timestamp", "time_stamp", "time_offset", "offset_time")
_LABEL_NAMES = ("label", "labels", "label_id", "class", "class_id", "semantic", "objtag")
_EPOCH_S = 1e8
"""No offset is so long, and no clock since 1970 shows less."""


@dataclass(frozen=True)
class TimesSeen:
    """When points of a cloud were measured, in a unit that nothing but the values tells."""

    field: str
    first: float
    span: float

    def guess(self, period_ns: float | None) -> PointTimes | None:
        """Guess the unit: that in which a cloud fills a period of its topic, else the longest that can be.

        None where no unit can be, or each of them.
        """
        if not self.span:
            return None
        longest = next((unit for unit, unit_ns in NS_BY_UNIT.items() if self.span * unit_ns <= LONGEST_NS), None)
        unit = (unit_that_fills(self.span, period_ns) if period_ns else None) or longest
        if unit is None:
            return None
        is_epoch = abs(self.first) * NS_BY_UNIT[unit] > _EPOCH_S * NS_BY_UNIT["s"]
        return PointTimes(field=self.field, unit=unit, since="epoch" if is_epoch else "stamp")  # type: ignore[arg-type]


@dataclass(frozen=True)
class CloudSeen:
    """What the first cloud of a topic tells."""

    fields: tuple[tuple[str, str], ...]  # names and types
    width: int
    height: int
    times: TimesSeen | None
    label_field: str | None
    ids: str  # what the labels look like
    highest_id: int

    def __str__(self) -> str:
        kinds = dict.fromkeys(kind for _, kind in self.fields)
        told = (f"{', '.join(name for name, each in self.fields if each == kind)} {kind}" for kind in kinds)
        return f"{self.width} x {self.height} points of {'; '.join(told)}"


def look_at_cloud(message: Any) -> CloudSeen:  # noqa: ANN401 - a class that rosbags makes
    """Look at a cloud.

    Raises:
        InputError: it has no x, y and z, or not the bytes that it says.
    """
    fields = {field.name: type_of(field) for field in message.fields}
    time, label = _named(_TIME_NAMES, fields, NUMBERS), _named(_LABEL_NAMES, fields, WHOLE)
    points = columns_of(message, Extras(label, time))
    return CloudSeen(
        fields=tuple(fields.items()),
        width=message.width,
        height=message.height,
        times=None if time is None else _times(points, time),
        label_field=label,
        ids="" if label is None else _ids(points[label]),
        highest_id=0 if label is None else int(points[label].max(initial=0)),
    )


def _named(names: Iterable[str], fields: dict[str, str], types: tuple[str, ...]) -> str | None:
    """Return the first field that has one of these names and a type of these."""
    return next((name for name, kind in fields.items() if name.lower() in names and kind in types), None)


def _times(points: NDArray[np.void], name: str) -> TimesSeen:
    values = times_of(points, name)
    return TimesSeen(name, float(values[0]), float(np.ptp(values))) if len(values) else TimesSeen(name, 0.0, 0.0)


def _ids(ids: Any) -> str:  # noqa: ANN401 - an array (N,) of whole numbers
    highest = int(ids.max(initial=0))
    if highest > LAST_LABEL_ID and np.isin(classes_of(ids), list(CLASSES)).all():
        return "semantickitti"
    return likely_ids(highest)
