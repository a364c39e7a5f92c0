"""Point clouds in messages: their fields by name, as columns of one row a point."""

from collections import Counter
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.recording.lidar import MAX_POINTS
from semgrid_eval.sources.ros2.mapping import LidarMap
from semgrid_eval.words import plural

PLACE = ("x", "y", "z")
INTENSITY = "intensity"
MAX_POINT_BYTES = 1024
_TYPES = dict(enumerate(("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"), start=1))
"""Names of numbers by what a PointField calls them."""
NUMBERS, WHOLE = tuple(_TYPES.values()), ("int8", "uint8", "int16", "uint16", "int32", "uint32")
_REAL = ("float32", "float64")
_NOT_A_NUMBER = np.errstate(invalid="ignore")
"""Numpy warns of those bit patterns that are signalling; all are left out, whichever they are."""


def type_of(field: Any) -> str:  # noqa: ANN401 - a class that rosbags makes
    """Return the type of a field's numbers, with their count where there is more than one in a point."""
    name = _TYPES.get(field.datatype, f"datatype {field.datatype}")
    return name if field.count <= 1 else f"{field.count} x {name}"


class Extras(NamedTuple):
    """The fields that are read beside place and intensity."""

    label: str | None = None
    time: str | None = None

    @classmethod
    def of(cls, lidar: LidarMap) -> "Extras":
        """Return those that a map names."""
        return cls(lidar.label_field, None if lidar.times is None else lidar.times.field)


def is_empty(message: Any) -> bool:  # noqa: ANN401
    """Return whether a cloud has neither points nor bytes, whatever fields it has: nothing was sent back."""
    return message.width * message.height == 0 and not len(message.data)


def require_layout(message: Any, extras: Extras) -> None:  # noqa: ANN401
    """Make sure that a cloud has the fields that are read, and the bytes that it says, before any array is made.

    Raises:
        InputError: it has not.
    """
    fields = {field.name: field for field in message.fields}
    counts = Counter(field.name for field in message.fields)
    for name, types in _read_fields(extras, fields).items():
        if name not in fields:
            raise InputError(f"has no field {name}; there are: {', '.join(fields) or 'none'}")
        if counts[name] > 1:
            raise InputError(f"has {counts[name]} fields {name}")
        if type_of(fields[name]) not in types:
            raise InputError(f"{name} is {type_of(fields[name])}; it is read from {', '.join(types)}")
        if fields[name].offset + np.dtype(type_of(fields[name])).itemsize > message.point_step:
            place = f"{name} begins at byte {fields[name].offset}"
            raise InputError(f"{place} and reaches beyond a point of {message.point_step} bytes")
    _require_size(message)


def columns_of(message: Any, extras: Extras) -> NDArray[np.void]:  # noqa: ANN401
    """Return the fields that are read (N,), row after row of an organised cloud, whatever rows end with.

    Raises:
        InputError: as `require_layout` does.
    """
    require_layout(message, extras)
    fields = {field.name: field for field in message.fields}
    names = list(_read_fields(extras, fields))
    order: Literal[">", "<"] = ">" if message.is_bigendian else "<"
    layout: Any = {
        "names": names,
        "formats": [np.dtype(type_of(fields[name])).newbyteorder(order) for name in names],
        "offsets": [fields[name].offset for name in names],
        "itemsize": message.point_step,
    }
    rows = np.asarray(message.data, np.uint8).reshape(message.height, message.row_step)
    used = np.ascontiguousarray(rows[:, : message.width * message.point_step])
    points: NDArray[np.void] = used.reshape(-1, message.point_step).view(np.dtype(layout))[:, 0]
    return points


@_NOT_A_NUMBER
def returned(points: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return which points are of something that sent light back: (N,)."""
    place_m = np.stack([points[axis] for axis in PLACE], axis=1)
    found: NDArray[np.bool_] = np.isfinite(place_m).all(axis=1) & place_m.any(axis=1)
    return found


@_NOT_A_NUMBER
def times_of(points: NDArray[np.void], name: str) -> NDArray[np.float64]:
    """Return the times of points that count, as they are written: those that are finite of points that came back."""
    values = points[name][returned(points)].astype(np.float64)
    known: NDArray[np.float64] = values[np.isfinite(values)]
    return known


def _read_fields(extras: Extras, present: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the fields that are read, each with the types that it may have."""
    found: dict[str, tuple[str, ...]] = dict.fromkeys(PLACE, _REAL)
    if INTENSITY in present:
        found[INTENSITY] = NUMBERS
    if extras.label is not None:
        found[extras.label] = WHOLE
    if extras.time is not None:
        found[extras.time] = NUMBERS
    return found


def _require_size(message: Any) -> None:  # noqa: ANN401
    count = message.width * message.height
    if count > MAX_POINTS:
        raise InputError(f"has {message.width} x {message.height} points; at most {MAX_POINTS} are allowed")
    if message.point_step > MAX_POINT_BYTES:
        raise InputError(f"has points of {message.point_step} bytes; at most {MAX_POINT_BYTES} are allowed")
    row_bytes = message.width * message.point_step
    if message.row_step < row_bytes:
        raise InputError(
            f"row_step {message.row_step} is less than {plural(message.width, 'point')} of {message.point_step}"
        )
    if len(message.data) != message.row_step * message.height:
        told = f"{plural(message.height, 'row')} of {message.row_step}"
        raise InputError(f"has {plural(len(message.data), 'byte')}, which are not {told}")
