"""What is expected of any recording: the one table of limits that `check` goes by unless it is given another."""

from functools import cache

from semgrid_eval.labels import LAST_TRAIN_ID
from semgrid_eval.log import topics
from semgrid_eval.log.contract import CAMERA, SINGLE, STEREO, Contract, Latency, Range, RangeBeside, TopicContract
from semgrid_eval.log.findings import Severity
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.motion import LIMITS

_ERROR = Severity.ERROR
_CALIBRATION, _STEREO = (camera_topic(CAMERA, each) for each in (topics.CALIBRATION, topics.STEREO))
_DISPARITY = camera_topic(STEREO, topics.DISPARITY)
_SINGLE_FRAME = camera_topic(SINGLE, topics.CALIBRATION)  # which every frame has, whatever pictures
_SINGLE_IMAGE = camera_topic(SINGLE, topics.IMAGE)
_PICTURE = "foxglove.CompressedImage"
_NEEDED = Range(low=1, severity=_ERROR)
_STEADY = TopicContract(
    messages=_NEEDED,
    repeated_times=Range(high=0, severity=_ERROR),
    gap_periods=Range(high=1.5),
    jitter_periods=Range(high=0.2),
)
# What a road vehicle, and its cameras, can plausibly be.
_MOTION = {
    **{name: Range(low=low, high=high, severity=_ERROR) for name, ((low, high), _) in LIMITS.items()},
    "acceleration_mps2": Range(low=-20, high=20),
}
_OPTICS = {
    "fx_px / width": Range(low=0.2, high=5),
    "fy_px / fx_px": Range(low=0.9, high=1.1),
    "u0_px / width": Range(low=0.2, high=0.8),
    "v0_px / height": Range(low=0.2, high=0.8),
}
_MOUNTING = {
    "baseline_m": Range(low=0.03, high=2),
    "z_m": Range(low=0.3, high=4),
    "roll_rad": Range(low=-0.5, high=0.5),
    "pitch_rad": Range(low=-0.5, high=0.5),
}


@cache
def default_contract() -> Contract:
    """Return what is expected of any recording."""
    motion = {"type": "semgrid.v1.Egomotion", "uncovered_s": RangeBeside(topic=_CALIBRATION, high=0), "values": _MOTION}
    disparity = {"type": _PICTURE, "values": {"valid_share": Range(low=0.02)}}
    return Contract(
        checksums=Severity.WARNING,
        sensors=_NEEDED,
        largest_label_id=Range(low=LAST_TRAIN_ID + 1),
        topics={
            topics.EGO_MOTION: _STEADY.model_copy(update=motion),
            _DISPARITY: _STEADY.model_copy(update=disparity),
            **_beside(_DISPARITY, STEREO),
            _SINGLE_FRAME: _STEADY,
            **_beside(_SINGLE_FRAME, SINGLE),
            _CALIBRATION: TopicContract(type="foxglove.CameraCalibration", messages=_NEEDED, values=_OPTICS),
            _STEREO: TopicContract(type="semgrid.v1.StereoCalibration", messages=_NEEDED, values=_MOUNTING),
        },
        # Motion is placed at its stamp, pictures at their log time: they must agree.
        latencies=tuple(
            Latency(topic=topic, seconds=Range(low=0, high=0, severity=_ERROR))
            for topic in (topics.EGO_MOTION, _DISPARITY, _SINGLE_IMAGE, camera_topic(CAMERA, topics.LABEL))
        ),
    )


def _beside(frames: str, cameras: str) -> dict[str, TopicContract]:
    """Expect labels and images of some cameras at the times of all their frames."""
    expected = TopicContract(type=_PICTURE, missing_beside=RangeBeside(topic=frames, high=0))
    return {camera_topic(cameras, channel): expected for channel in (topics.LABEL, topics.IMAGE)}
