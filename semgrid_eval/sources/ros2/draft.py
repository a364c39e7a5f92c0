"""A first map file, guessed from types and names, with comments on what was guessed."""

from collections.abc import Iterator

from semgrid_eval.config import yaml_word
from semgrid_eval.errors import printable
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.contents import Contents
from semgrid_eval.sources.ros2.draft_cameras import draft_cameras
from semgrid_eval.sources.ros2.draft_lidars import draft_lidars

_VEHICLE_FRAMES = ("base_link", "base_footprint", "ego_vehicle", "vehicle")


def draft_map(contents: Contents) -> str:
    """Return a map file as text; what could not be guessed is left open there, and says so."""
    vehicle = _vehicle_frame(contents)
    lines = [
        "# Which topics of a bag are what; docs/own-car.md says what else can stand here.",
        "vehicle:",
        f"  frame: {yaml_word(vehicle)}  # x ahead, y left, z up",
        "  height_m: 0.0  # of its origin above the ground",
        "  rear_axle_m: 0.0  # how far its origin lies ahead of the rear axle",
        *(["clock: received  # header stamps are all zero"] if contents.unstamped else []),
        *_motion(contents, vehicle),
        *draft_cameras(contents, vehicle),
        *draft_lidars(contents, vehicle),
    ]
    return "".join(f"{printable(line)}\n" for line in lines)  # names in comments may be anything


def _vehicle_frame(contents: Contents) -> str:
    children = [seen.child for seen in contents.topics.values() if seen.kind == kinds.ODOMETRY and seen.child]
    known = [name for name in _VEHICLE_FRAMES if name in contents.transforms.frames]
    return next(iter([*known, *children]), _VEHICLE_FRAMES[0])


def _motion(contents: Contents, vehicle: str) -> Iterator[str]:
    odometry, twists, imus = (_of_kind(contents, kind) for kind in (kinds.ODOMETRY, kinds.TWIST, kinds.IMU))
    yield "motion:"
    if told := [*odometry, *twists]:
        note = "  # or by: pose" if odometry else ""
        yield f"  speed: {{topic: {yaml_word(told[0])}, by: twist}}{note}"
    else:
        yield "  speed: {topic: }  # nothing in the bag tells it: nav_msgs/Odometry or geometry_msgs/TwistStamped"
    if imus and not odometry:
        frame = contents.topics[imus[0]].frame
        is_linked = frame == vehicle or contents.transforms.has(vehicle, frame)
        note = "" if is_linked else "  # nothing links its frame to the vehicle: are its axes those of the vehicle?"
        yield f"  yaw_rate: {{topic: {yaml_word(imus[0])}, aligned: {'false' if is_linked else 'true'}}}{note}"


def _of_kind(contents: Contents, kind: str) -> list[str]:
    return [name for name, seen in contents.topics.items() if seen.kind == kind and seen.count]
