"""The kinds of sensors: who adds one adds its line to `KINDS`."""

import heapq
import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, SerializeAsAny, StringConstraints

from semgrid_eval.sensors.camera import CameraSensor, read_cameras
from semgrid_eval.sensors.sensor import Kind, Points, SensorConfig

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader

KINDS: dict[str, Kind] = {"camera": Kind(CameraSensor, read_cameras)}
_DEFAULT_KIND = "camera"


def _of_its_kind(value: object) -> object:
    """Turn a mapping into the settings of its kind."""
    if not isinstance(value, Mapping):
        return value
    kind = value.get("kind", _DEFAULT_KIND)
    if kind not in tuple(KINDS):
        raise ValueError(f"kind {kind!r} is not one of {', '.join(KINDS)}")
    config = KINDS[kind].config
    if unknown := [key for key in value if key not in config.model_fields]:
        raise ValueError(f"unknown key {unknown[0]!r}; allowed here: {', '.join(sorted(config.model_fields))}")
    return config.model_validate_json(json.dumps(value, default=str))


SensorName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Sensor = SerializeAsAny[Annotated[SensorConfig, BeforeValidator(_of_its_kind)]]
"""Settings of a sensor of any kind; `kind` tells which, a camera where it is left out."""


def read_points(
    log: "LogReader", sensors: Mapping[str, SensorConfig], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what sensors of all kinds saw, in the order of time; `class_by_label` is as `Kind` says.

    Raises:
        LogError: the log is damaged or lacks what a sensor needs.
    """
    by_kind: dict[str, dict[str, SensorConfig]] = {}
    for name, sensor in sensors.items():
        by_kind.setdefault(sensor.kind, {})[name] = sensor
    streams = [KINDS[kind].read(log, chosen, class_by_label) for kind, chosen in by_kind.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)
