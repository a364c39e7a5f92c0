"""What the first cloud of a topic tells: its fields, and which of them look like times and labels."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from semgrid_eval.sources.kitti.labels import CLASSES, classes_of
from semgrid_eval.sources.ros2.clouds import NUMBERS, WHOLE, Extras, columns_of, type_of
from semgrid_eval.sources.ros2.labels import likely_ids
from semgrid_eval.sources.ros2.lidars import LONGEST_NS, NS_BY_UNIT
from semgrid_eval.sources.ros2.mapping import PointTimes

_TIME_NAMES = ("t", "time", "timestamp", "time_stamp", "time_offset", "offset_time")
_LABEL_NAMES = ("label", "labels", "label_id", "class", "class_id", "semantic", "objtag")
_EPOCH_S = 1e8
"""No offset is so long, and no clock since 1970 shows less."""
_LAST_LABEL_ID = 33


@dataclass(frozen=True)
class CloudSeen:
    """What the first cloud of a topic tells."""

    fields: tuple[tuple[str, str], ...]  # names and types
    width: int
    height: int
    times: PointTimes | None  # that tell when points were measured, as far as can be guessed
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
        times=None if time is None else _times(time, points[time]),
        label_field=label,
        ids="" if label is None else _ids(points[label]),
        highest_id=0 if label is None else int(points[label].max(initial=0)),
    )


def _named(names: Iterable[str], fields: dict[str, str], types: tuple[str, ...]) -> str | None:
    """Return the first field that has one of these names and a type of these."""
    return next((name for name, kind in fields.items() if name.lower() in names and kind in types), None)


def _times(field: str, values: Any) -> PointTimes | None:  # noqa: ANN401 - an array (N,) of numbers
    """Guess the unit: the longest in which a cloud takes no more than the longest turn."""
    known = values.astype(np.float64)[np.isfinite(values)]
    if not len(known):
        return None
    for unit, unit_ns in NS_BY_UNIT.items():
        if np.ptp(known) * unit_ns <= LONGEST_NS:
            is_epoch = abs(float(known[0])) * unit_ns > _EPOCH_S * NS_BY_UNIT["s"]
            return PointTimes(field=field, unit=unit, since="epoch" if is_epoch else "stamp")  # type: ignore[arg-type]
    return None


def _ids(ids: Any) -> str:  # noqa: ANN401 - an array (N,) of whole numbers
    highest = int(ids.max(initial=0))
    if highest > _LAST_LABEL_ID and np.isin(classes_of(ids), list(CLASSES)).all():
        return "semantickitti"
    return likely_ids(highest)
