"""The LiDARs of a first map file, guessed from the first clouds of a bag."""

import re
from collections.abc import Iterator

from semgrid_eval.config import yaml_word
from semgrid_eval.sources.ros2.clouds_seen import CloudSeen, TimesSeen
from semgrid_eval.sources.ros2.contents import Contents, Seen

_ONLY = "top"
_NS_PER_S = 1e9
_GENERIC = {"points", "points_raw", "point_cloud", "pointcloud", "cloud", "packets", "lidar", "sensing"}


def draft_lidars(contents: Contents, vehicle: str) -> Iterator[str]:
    """Write a block for each topic of clouds that can be read, but for those that are made of a camera's pictures."""
    swept = _swept(contents)
    if swept:
        yield "lidars:"
    for name, (topic, seen) in zip(lidar_names(contents), swept.items(), strict=True):
        assert seen.cloud is not None
        yield f"  {yaml_word(name)}:"
        yield f"    cloud: {yaml_word(topic)}"
        yield from _fields(seen.cloud, seen.rate_hz)
        yield from place_lines(contents, vehicle, seen.frame or "the LiDAR", "it")
    for topic in sorted(_clouds(contents).keys() - swept.keys()):
        yield f"# {topic} has the frame of a camera, as points made of its pictures have: left out."


def _clouds(contents: Contents) -> dict[str, Seen]:
    return {name: seen for name, seen in contents.topics.items() if seen.cloud is not None}


def _swept(contents: Contents) -> dict[str, Seen]:
    pictured = {seen.frame for seen in contents.topics.values() if seen.shape is not None}
    return {name: seen for name, seen in _clouds(contents).items() if seen.frame not in pictured}


def lidar_names(contents: Contents) -> list[str]:
    """Name the LiDARs of the map by what is particular in their topics."""
    topics = list(_swept(contents))
    if len(topics) == 1:
        return [_ONLY]
    parts = [[part for part in re.findall(r"[A-Za-z0-9_-]+", topic) if part not in _GENERIC] for topic in topics]
    names = ["_".join(each) or f"lidar{number}" for number, each in enumerate(parts, start=1)]
    return names if len(set(names)) == len(names) else [f"lidar{number}" for number in range(1, len(topics) + 1)]


def _fields(cloud: CloudSeen, rate_hz: float | None) -> Iterator[str]:
    yield _times(cloud.times, rate_hz)
    if cloud.label_field is None:
        yield "    # no labels of points: a camera can colour them, `colour_from` of the sensor in a grid"
    else:
        yield f"    label_field: {yaml_word(cloud.label_field)}"
        yield f"    ids: {cloud.ids}  # the first cloud holds ids up to {cloud.highest_id}; or names: {{road: [40]}}"


def _times(seen: TimesSeen | None, rate_hz: float | None) -> str:
    counted = "all of a cloud count as measured at its stamp"
    if seen is None:
        return f"    # no times of points: {counted}"
    times = seen.guess(_NS_PER_S / rate_hz if rate_hz else None)
    if times is None:
        told = f"the first cloud does not tell the unit of {seen.field}; without times {counted}"
        return f"    # times: {{field: {yaml_word(seen.field)}, unit: , since: }}  # {told}"
    return f"    times: {{field: {yaml_word(times.field)}, unit: {times.unit}, since: {times.since}}}  # of each point"


def place_lines(contents: Contents, vehicle: str, frame: str, sensor: str) -> Iterator[str]:
    """Say where a sensor sits: nothing where tf tells it, else what has to be measured."""
    if contents.transforms.has(vehicle, frame):
        yield f"    # extrinsics: from tf, {vehicle} to {frame}"
    else:
        yield f"    # Nothing in the bag links {vehicle} to {frame}: measure where {sensor} sits."
        yield "    extrinsics: {x_m: , y_m: , z_m: , roll_rad: 0.0, pitch_rad: 0.0, yaw_rad: 0.0}"
