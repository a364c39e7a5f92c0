"""Calibrations of cameras as the two messages of a log, and back; reading a damaged one raises DecodeError."""

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration as CalibrationMessage

from semgrid_eval.errors import InputError
from semgrid_eval.log.codec import timestamp
from semgrid_eval.log.schemas.stereo_calibration_pb2 import CameraExtrinsics, StereoCalibration
from semgrid_eval.log.topics import BASE_FRAME, optical_frame
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.types import CameraCalibration

_INTRINSICS = ("fx_px", "fy_px", "u0_px", "v0_px")
_EXTRINSICS = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")


def calibration_messages(
    stamp_ns: int, camera: str, calibration: CameraCalibration, size_px: tuple[int, int]
) -> tuple[CalibrationMessage, StereoCalibration]:
    """Split a calibration into what viewers know, for pictures of a size (width, height), and what they do not."""
    fx, fy, u0, v0 = (getattr(calibration, name) for name in _INTRINSICS)
    width, height = size_px
    known = CalibrationMessage(
        timestamp=timestamp(stamp_ns),
        frame_id=optical_frame(camera),
        width=width,
        height=height,
        distortion_model="plumb_bob",  # pictures are rectified, so all five coefficients are zero
        D=[0.0] * 5,
        K=[fx, 0.0, u0, 0.0, fy, v0, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, u0, 0.0, 0.0, fy, v0, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
    rest = StereoCalibration(
        timestamp=timestamp(stamp_ns),
        frame_id=optical_frame(camera),
        parent_frame_id=BASE_FRAME,
        baseline_m=calibration.baseline_m,  # None leaves it 0
        extrinsics=CameraExtrinsics(**{name: getattr(calibration, name) for name in _EXTRINSICS}),
    )
    return known, rest


def read_size(known: bytes) -> ImageSize:
    """Return the size of the pictures that the first message of `calibration_messages` is for.

    Raises:
        InputError: it is none.
    """
    camera = CalibrationMessage.FromString(known)
    size = ImageSize(camera.width, camera.height)
    if not size.width * size.height:
        raise InputError(f"is for pictures of {size}")
    return size


def read_calibration(known: bytes, rest: bytes) -> CameraCalibration:
    """Join the two messages of `calibration_messages`.

    Raises:
        ValueError: the camera matrix is incomplete.
        InputError: a value is impossible; the message names the field.
    """
    camera, stereo = CalibrationMessage.FromString(known), StereoCalibration.FromString(rest)
    if len(camera.K) != 9:
        raise ValueError(f"a camera matrix has {len(camera.K)} values")
    return CameraCalibration(
        **dict(zip(_INTRINSICS, (camera.K[0], camera.K[4], camera.K[2], camera.K[5]), strict=True)),
        baseline_m=stereo.baseline_m or None,
        **{name: getattr(stereo.extrinsics, name) for name in _EXTRINSICS},
    )
