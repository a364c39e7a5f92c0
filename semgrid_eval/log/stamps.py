"""The stamp inside a message, whatever its type."""

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from semgrid_eval.log.codec import stamp_ns
from semgrid_eval.log.schemas.actors_pb2 import Actors
from semgrid_eval.log.schemas.egomotion_pb2 import Egomotion
from semgrid_eval.log.schemas.stereo_calibration_pb2 import StereoCalibration

_STAMPED = {
    each.DESCRIPTOR.full_name: each
    for each in (CameraCalibration, CompressedImage, PointCloud, PoseInFrame, Actors, Egomotion, StereoCalibration)
}


def stamp_of(schema: str, data: bytes) -> int | None:
    """Return the stamp of a message (ns), None where its type has none that is known here.

    Raises:
        DecodeError: the message is damaged.
        ValueError: the stamp is negative or beyond 2^63 ns.
    """
    if schema == FrameTransforms.DESCRIPTOR.full_name:
        transforms = FrameTransforms.FromString(data).transforms
        return stamp_ns(transforms[0].timestamp) if transforms else None
    kind = _STAMPED.get(schema)
    return None if kind is None else stamp_ns(kind.FromString(data).timestamp)
