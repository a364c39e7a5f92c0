"""Sweeps of LiDARs as point clouds, and back.

A message holds one turn. Its pose takes points to `base_link`; each point is packed, without gaps, as

    x, y, z      float32   metres in the LiDAR's own frame, at the time of the message
    intensity    float32   as the LiDAR gives it
    label        uint8     Cityscapes label id; absent where the points have none

Logs of others are read where these fields have these types, wherever they lie and whatever else there is.
"""

from typing import Any

import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from semgrid_eval.log.codec import stamp_ns, timestamp
from semgrid_eval.log.topics import BASE_FRAME
from semgrid_eval.recording.lidar import MAX_POINTS, LidarSweep, Mount

_PLACE = ("x", "y", "z")
_FIELDS = {**dict.fromkeys((*_PLACE, "intensity"), "<f4"), "label": "u1"}
_TYPES = {"<f4": PackedElementField.FLOAT32, "u1": PackedElementField.UINT8}
_MAX_STRIDE_BYTES = 1024


def sweep_message(sweep: LidarSweep) -> PointCloud:
    """Write a sweep."""
    names = [name for name in _FIELDS if name != "label" or sweep.label_id is not None]
    packed = np.empty(len(sweep.points_m), [(name, _FIELDS[name]) for name in names])
    for axis, name in enumerate(_PLACE):
        packed[name] = sweep.points_m[:, axis]
    packed["intensity"] = sweep.intensity
    if sweep.label_id is not None:
        packed["label"] = sweep.label_id
    offsets: Any = packed.dtype.fields
    fields = [PackedElementField(name=name, offset=offsets[name][1], type=_TYPES[_FIELDS[name]]) for name in names]
    return PointCloud(
        timestamp=timestamp(sweep.stamp_ns),
        frame_id=BASE_FRAME,
        pose=_pose(sweep.mount),
        point_stride=packed.dtype.itemsize,
        fields=fields,
        data=packed.tobytes(),
    )


def read_sweep(data: bytes) -> LidarSweep:
    """Read a sweep.

    Raises:
        ValueError: it is in another frame, or its points are not packed as they have to be.
        InputError: its points are impossible, as `LidarSweep` says.
    """
    message = PointCloud.FromString(data)
    if message.frame_id != BASE_FRAME:
        raise ValueError(f"a sweep is in frame {message.frame_id[:40]!r}, not {BASE_FRAME}")
    packed = _unpacked(message)
    names = packed.dtype.names or ()
    place, turn = message.pose.position, message.pose.orientation
    mount = Mount((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
    if not np.isfinite([*mount.place_m, *mount.ego_from_sensor.rotation.ravel()]).all():
        raise ValueError(f"a LiDAR is at {mount.place_m}")
    return LidarSweep(
        stamp_ns=stamp_ns(message.timestamp),
        mount=mount,
        points_m=np.stack([packed[name] for name in _PLACE], axis=1).astype(np.float32, copy=False),
        intensity=packed["intensity"].astype(np.float32),
        label_id=packed["label"].astype(np.uint8) if "label" in names else None,
    )


def _unpacked(message: PointCloud) -> Any:  # noqa: ANN401 - a structured array (N,)
    """View the bytes of a message as an array of those fields that are known."""
    stride = message.point_stride
    found = {field.name: field for field in message.fields if field.name in _FIELDS}
    if missing := [name for name in _FIELDS if name not in found and name != "label"]:
        raise ValueError(f"a sweep has no field {missing[0]}")
    for name, field in found.items():
        size = np.dtype(_FIELDS[name]).itemsize
        if field.type != _TYPES[_FIELDS[name]] or field.offset + size > stride:
            raise ValueError(f"field {name} of a sweep has another type or place than it must")
    if not 0 < stride <= _MAX_STRIDE_BYTES or len(message.data) % stride:
        raise ValueError(f"a sweep of {len(message.data)} bytes does not hold points of {stride} bytes")
    if len(message.data) // stride > MAX_POINTS:
        raise ValueError(f"a sweep has {len(message.data) // stride} points; at most {MAX_POINTS} are allowed")
    layout: Any = {
        "names": list(found),
        "formats": [_FIELDS[name] for name in found],
        "offsets": [field.offset for field in found.values()],
        "itemsize": stride,
    }
    return np.frombuffer(message.data, np.dtype(layout))


def _pose(mount: Mount) -> Pose:
    position = Vector3(**dict(zip("xyz", mount.place_m, strict=True)))
    return Pose(position=position, orientation=Quaternion(**dict(zip("xyzw", mount.turn, strict=True))))
