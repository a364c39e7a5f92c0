"""What a log says of itself as its metadata, frames, motion and truth as its messages, and back.

Reading a damaged message raises DecodeError.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Pose_pb2 import Pose as PoseMessage
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.files import digest_value, require_file_name
from semgrid_eval.geometry import optical_quaternion
from semgrid_eval.log.schemas.actors_pb2 import Actor as ActorMessage
from semgrid_eval.log.schemas.actors_pb2 import Actors
from semgrid_eval.log.schemas.egomotion_pb2 import Egomotion
from semgrid_eval.log.topics import BASE_FRAME, GRID_FRAME, MAP_FRAME, ODOM_FRAME, optical_frame
from semgrid_eval.recording.colour import kind_of
from semgrid_eval.recording.types import Actor, CameraCalibration, MotionSample, Pose, Quantity

RECORD = "semgrid.scene"
"""The metadata record that says what a log is as a whole."""
CONDITIONS_RECORD = "semgrid.conditions"
"""The metadata record of a recording's conditions, each as `0.31 px`; only where the source has some to tell."""
PREDICTIONS_RECORD = "semgrid.predictions"
"""The metadata record of a log that holds predictions of one recording."""
PLAYBACK_RECORD = "semgrid.playback"
"""The metadata record of a run's log to play."""
FORMAT_VERSION = 1
_NS_PER_S = 1_000_000_000
_MAX_STAMP_NS = 1 << 63
_WORDS, _LISTS = ("name", "dataset", "split", "source_digest"), ("cameras", "class_names")  # of a scene
_SHOWN = 40
_GPS_FIELDS = ("latitude_deg", "longitude_deg", "heading_deg")
_ACTOR_FIELDS = tuple(Actor.__dataclass_fields__)


@dataclass(frozen=True)
class Scene:
    """A log's name, origin and cameras."""

    name: str  # unique in its data set
    dataset: str  # where the recording comes from: `cityscapes` or `synthetic`
    split: str  # `train`, `val` or `test`
    cameras: tuple[str, ...]  # their names, sorted
    source_digest: str  # digest of everything that determined the content
    class_names: tuple[str, ...] = CLASS_NAMES  # the grid classes when the log was written
    group: str = ""  # the town, city or drive that it belongs to; empty where the log does not say

    def to_metadata(self) -> dict[str, str]:
        """Return the entries of the metadata record, with a digest of their own: MCAP has no checksum for them."""
        entries = {
            "format_version": str(FORMAT_VERSION),
            "name": self.name,
            "dataset": self.dataset,
            "split": self.split,
            "cameras": json.dumps(self.cameras),
            "source_digest": self.source_digest,
            "class_names": json.dumps(self.class_names),
            **({"group": self.group} if self.group else {}),
        }
        return {**entries, "digest": digest_value(entries)}

    @classmethod
    def from_metadata(cls, entries: dict[str, str]) -> "Scene":
        """Read the entries of the metadata record.

        Raises:
            ValueError: they are damaged, incomplete or of another format version.
        """
        given = {key: value for key, value in entries.items() if key != "digest"}
        if not is_scene_whole(entries):
            raise ValueError(f"metadata {RECORD} does not match its digest")
        if given.get("format_version") != str(FORMAT_VERSION):
            raise ValueError(f"its format version is {given.get('format_version')}; {FORMAT_VERSION} can be read")
        if missing := [name for name in (*_WORDS, *_LISTS) if name not in given]:
            raise ValueError(f"metadata {RECORD} does not say its {missing[0]}")
        for key in ("name", "split"):
            require_file_name(given[key], key)
        words: dict[str, Any] = {name: given[name] for name in _WORDS}
        lists: dict[str, Any] = {name: _names(given[name], name) for name in _LISTS}
        return cls(**words, **lists, group=given.get("group", ""))


def _json(text: str) -> Any:  # noqa: ANN401 - anything that JSON can hold; None for what is no JSON
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _names(text: str, what: str) -> tuple[str, ...]:
    found = _json(text)
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError(f"its {what} {text[:_SHOWN]!r} are not a list of names")
    return tuple(found)


def is_scene_whole(entries: Mapping[str, str]) -> bool:
    """Tell whether the entries of the metadata record of a scene are those that were written."""
    given = {key: value for key, value in entries.items() if key != "digest"}
    return entries.get("digest") == digest_value(given)


def conditions_metadata(conditions: Mapping[str, Quantity]) -> dict[str, str]:
    """Write the conditions of a recording as entries of a metadata record."""
    return {name: f"{each.value!r} {each.unit}" for name, each in sorted(conditions.items())}


def read_conditions(entries: Mapping[str, str]) -> dict[str, Quantity]:
    """Read the entries of the metadata record of conditions.

    Raises:
        ValueError: one does not begin with a finite number.
    """
    parts = {name: text.partition(" ") for name, text in entries.items()}
    found = {name: Quantity(_json(value), unit) for name, (value, _, unit) in parts.items()}
    for name, each in found.items():
        if type(each.value) not in (int, float) or not math.isfinite(each.value):
            raise ValueError(f"its condition {name[:_SHOWN]!r} is not a number")
    return found


def timestamp(stamp_ns: int) -> Timestamp:
    """Write integer nanoseconds as seconds and nanoseconds."""
    return Timestamp(seconds=stamp_ns // _NS_PER_S, nanos=stamp_ns % _NS_PER_S)


def stamp_ns(message_timestamp: Timestamp) -> int:
    """Read seconds and nanoseconds as integer nanoseconds.

    Raises:
        ValueError: they are negative or beyond 2^63 ns.
    """
    found = message_timestamp.seconds * _NS_PER_S + message_timestamp.nanos
    if not 0 <= found < _MAX_STAMP_NS:
        raise ValueError(f"a message says that its time is {found} ns")
    return found


def image_message(stamp_ns: int, camera: str, file: bytes) -> CompressedImage:
    """Wrap a PNG or JPEG file of a camera."""
    time = timestamp(stamp_ns)
    return CompressedImage(timestamp=time, frame_id=optical_frame(camera), data=file, format=kind_of(file))


def read_image(data: bytes) -> bytes:
    """Return the PNG or JPEG file in a message."""
    return bytes(CompressedImage.FromString(data).data)


def motion_message(sample: MotionSample) -> Egomotion:
    """Write what the vehicle reports of its motion."""
    gps = {name: getattr(sample, name) for name in _GPS_FIELDS if getattr(sample, name) is not None}
    return Egomotion(
        timestamp=timestamp(sample.stamp_ns),
        frame_id=BASE_FRAME,
        speed_mps=sample.speed_mps,
        yaw_rate_radps=sample.yaw_rate_radps,
        **gps,
    )


def read_motion(data: bytes) -> MotionSample:
    """Read what the vehicle reported of its motion."""
    message = Egomotion.FromString(data)
    gps = {name: getattr(message, name) for name in _GPS_FIELDS if message.HasField(name)}
    return MotionSample(stamp_ns(message.timestamp), message.speed_mps, message.yaw_rate_radps, **gps)


def pose_message(pose: Pose, frame_id: str) -> PoseInFrame:
    """Write a planar pose in a frame."""
    return PoseInFrame(
        timestamp=timestamp(pose.stamp_ns),
        frame_id=frame_id,
        pose=PoseMessage(position=Vector3(x=pose.x_m, y=pose.y_m, z=0.0), orientation=_turned_by(pose.yaw_rad)),
    )


def read_pose(data: bytes) -> Pose:
    """Read a planar pose; its yaw comes back within rounding and but for double turns, and gives the same message."""
    message = PoseInFrame.FromString(data)
    position = message.pose.position
    return Pose(stamp_ns(message.timestamp), position.x, position.y, _yaw_rad(message.pose.orientation))


def actors_message(stamp_ns: int, actors: tuple[Actor, ...]) -> Actors:
    """Write the true boxes of all actors at one time."""
    boxes = [ActorMessage(**{name: getattr(actor, name) for name in _ACTOR_FIELDS}) for actor in actors]
    return Actors(timestamp=timestamp(stamp_ns), frame_id=MAP_FRAME, actors=boxes)


def read_actors(data: bytes) -> tuple[int, tuple[Actor, ...]]:
    """Read the true boxes of all actors and their time."""
    message = Actors.FromString(data)
    boxes = (Actor(**{name: getattr(actor, name) for name in _ACTOR_FIELDS}) for actor in message.actors)
    return stamp_ns(message.timestamp), tuple(boxes)


def transforms_message(
    pose: Pose, calibrations: dict[str, CameraCalibration], *, grid_yaw_rad: float = 0.0
) -> FrameTransforms:
    """Write where vehicle, grid and cameras are when the vehicle stands at `pose` in the odom frame.

    The grid never turns: it points to `grid_yaw_rad` in the odom frame.
    """
    position = (pose.x_m, pose.y_m, 0.0)
    time = timestamp(pose.stamp_ns)
    transforms = [
        _transform(time, ODOM_FRAME, BASE_FRAME, position, _turned_by(pose.yaw_rad)),
        _transform(time, ODOM_FRAME, GRID_FRAME, position, _turned_by(grid_yaw_rad)),
    ]
    for camera, calibration in sorted(calibrations.items()):
        place = (calibration.x_m, calibration.y_m, calibration.z_m)
        turn = optical_quaternion(calibration.roll_rad, calibration.pitch_rad, calibration.yaw_rad)
        rotation = Quaternion(**dict(zip("xyzw", turn, strict=True)))
        transforms.append(_transform(time, BASE_FRAME, optical_frame(camera), place, rotation))
    return FrameTransforms(transforms=transforms)


def _transform(
    time: Timestamp, parent: str, child: str, position: tuple[float, float, float], rotation: Quaternion
) -> FrameTransform:
    translation = Vector3(**dict(zip("xyz", position, strict=True)))
    return FrameTransform(
        timestamp=time, parent_frame_id=parent, child_frame_id=child, translation=translation, rotation=rotation
    )


def _turned_by(yaw_rad: float) -> Quaternion:
    half_rad = math.remainder(yaw_rad / 2, math.tau)  # nothing but rounding depends on whole turns of the quaternion
    return Quaternion(x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad))


def _yaw_rad(turn: Quaternion) -> float:
    """Undo `_turned_by`: of the angle found and its two neighbours, take the one that gives these very numbers."""
    found = 2 * math.atan2(turn.z, turn.w)
    near = (found, math.nextafter(found, -math.inf), math.nextafter(found, math.inf))
    return next((yaw for yaw in near if (math.sin(yaw / 2), math.cos(yaw / 2)) == (turn.z, turn.w)), found)
