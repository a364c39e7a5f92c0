"""Brings the observations of several sensors, each with times of its own, to the times of one of them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from semgrid_eval.sensors.sensor import Points, SensorConfig

TOLERANCE_NS = 1_000_000
"""Cameras that are triggered together do not stamp alike: what is this much later is taken for simultaneous."""


@dataclass(frozen=True)
class Snapshot:
    """What all sensors have seen last at a time; a sensor without a recent observation is left out."""

    stamp_ns: int
    points: Mapping[str, Points]


def synchronise(observations: Iterable[Points], sensors: Mapping[str, SensorConfig], leader: str) -> Iterator[Snapshot]:
    """Iterate over the times of the leading sensor with the newest observation that each sensor had made by then.

    Observations are of all sensors, in the order of time; `sensors` say how old one may be.
    """
    newest: dict[str, Points] = {}
    now: Points | None = None
    for points in observations:
        if now is not None and (points.sensor == leader or points.stamp_ns > now.stamp_ns + TOLERANCE_NS):
            yield _snapshot(now, newest, sensors)
            now = None
        newest[points.sensor] = points
        if points.sensor == leader:
            now = points
    if now is not None:
        yield _snapshot(now, newest, sensors)


def _snapshot(now: Points, newest: Mapping[str, Points], sensors: Mapping[str, SensorConfig]) -> Snapshot:
    recent = {
        name: points
        for name, points in newest.items()
        if now.stamp_ns - points.stamp_ns <= sensors[name].max_age_s * 1e9
    }
    return Snapshot(now.stamp_ns, recent)
