"""Check a log: is it whole, are its channels complete, and are times, calibration, motion and pictures plausible?"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from statistics import median, quantiles

import numpy as np

from semgrid_eval.classes import CITYSCAPES_LABELS
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log import topics
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.motion import LIMITS
from semgrid_eval.recording.png import decode_gray, read_header
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, MotionSample, Quantity

ACCELERATION_MPS2 = (-20.0, 20.0)
VALID_DISPARITY = 0.02
GAP_PERIODS = 1.5
JITTER_PERIODS = 0.2
_LAST_LABEL_ID = max(label.label_id for label in CITYSCAPES_LABELS)
_LAST_TRAIN_ID = max(label.train_id for label in CITYSCAPES_LABELS if label.train_id != 255)
_NS_PER_S = 1e9

_SCHEMAS = {
    **dict.fromkeys((topics.DISPARITY, topics.LABEL, topics.IMAGE), "foxglove.CompressedImage"),
    topics.CALIBRATION: "foxglove.CameraCalibration",
    topics.STEREO: "semgrid.v1.StereoCalibration",
}
_NEEDED = (topics.DISPARITY, topics.CALIBRATION, topics.STEREO)


class Severity(StrEnum):
    """An error makes a log unusable or its results wrong; a warning is worth a look."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd in a log; `place` is the topic or field."""

    severity: Severity
    place: str
    message: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.place}: {self.message}"


@dataclass(frozen=True)
class LogReport:
    """What a check found: message counts by topic, the time covered, and findings; a log is good without errors.

    `conditions` are what the log says of the recording's.
    """

    path: Path
    counts: dict[str, int]
    duration_s: float
    findings: tuple[Finding, ...]
    conditions: dict[str, Quantity]

    @property
    def good(self) -> bool:
        """Whether there is no error."""
        return all(finding.severity is not Severity.ERROR for finding in self.findings)


def check_log(path: Path) -> LogReport:
    """Check one log; whatever is wrong with it is a finding, not an exception."""
    findings: list[Finding] = []
    stamps_ns: dict[str, list[int]] = {}
    conditions: dict[str, Quantity] = {}
    try:
        with LogReader(path) as log:
            log.verify()
            conditions = log.conditions()
            log.attachments()
            stamps_ns = log.stamps_ns()
            for finding in _findings(log, stamps_ns):  # one by one: those before damage count as well
                findings.append(finding)
    except LogError as error:
        findings.append(_error("file", str(error).removeprefix(f"{path}: ")))
    times_ns = [stamp for stamps in stamps_ns.values() for stamp in stamps]
    duration_s = (max(times_ns) - min(times_ns)) / _NS_PER_S if times_ns else 0.0
    counts = {topic: len(stamps) for topic, stamps in sorted(stamps_ns.items())}
    return LogReport(path, counts, duration_s, tuple(findings), conditions)


def _findings(log: LogReader, stamps_ns: dict[str, list[int]]) -> Iterator[Finding]:
    if not log.has_checksums:
        yield _warning("file", "has no checksums, so damage cannot be seen")
    if recovered := log.recovered():
        yield _warning("file", str(recovered))
    if not log.scene.cameras:
        yield _error("cameras", "there is none")
    label_ids: set[int] = set()
    for camera in log.scene.cameras:
        broken = list(_channels(log, camera, stamps_ns))
        yield from broken
        if not any(finding.severity is Severity.ERROR for finding in broken):
            yield from _times(camera_topic(camera, topics.DISPARITY), stamps_ns)
            label_ids |= yield from _pictures(log, camera)
    if label_ids and max(label_ids) <= _LAST_TRAIN_ID:
        what = f"the largest is {max(label_ids)}, so they look like train ids"
        yield _warning("labels", f"{what}; convert again with --train-ids")
    yield from _times(topics.EGO_MOTION, stamps_ns)
    yield from _coverage(log, stamps_ns)
    yield from _motion(log.motion())


def _error(place: str, message: str) -> Finding:
    return Finding(Severity.ERROR, place, message)


def _warning(place: str, message: str) -> Finding:
    return Finding(Severity.WARNING, place, message)


def _channels(log: LogReader, camera: str, stamps_ns: dict[str, list[int]]) -> Iterator[Finding]:
    schemas = log.schemas()
    for channel, schema in _SCHEMAS.items():
        topic = camera_topic(camera, channel)
        if topic in schemas and schemas[topic] != schema:
            yield _error(topic, f"holds {schemas[topic] or 'untyped'} messages; {schema} is needed")
        elif channel in _NEEDED and not stamps_ns.get(topic):
            yield _error(topic, "has no message")
    frames = set(stamps_ns.get(camera_topic(camera, topics.DISPARITY), ()))
    for channel in (topics.IMAGE, topics.LABEL):
        topic = camera_topic(camera, channel)
        missing = len(frames - set(stamps_ns.get(topic, ())))
        if missing:
            yield _warning(topic, f"is missing for {missing} of {len(frames)} disparity images")


def _times(topic: str, stamps_ns: dict[str, list[int]]) -> Iterator[Finding]:
    """Look for repeated times, gaps and jitter; the median step is the period."""
    steps_ns = [after - before for before, after in pairwise(stamps_ns.get(topic, ()))]
    if not steps_ns:
        return
    period_ns = median(steps_ns)
    if min(steps_ns) == 0:
        yield _error(topic, f"{steps_ns.count(0)} messages have the time of the message before")
        return
    gaps = [step for step in steps_ns if step > GAP_PERIODS * period_ns]
    if gaps:
        worst = f"the longest is {max(gaps) / _NS_PER_S:.3f} s"
        yield _warning(topic, f"has {len(gaps)} gaps at a period of {period_ns / _NS_PER_S:.3f} s; {worst}")
    lower_ns, _, upper_ns = quantiles(steps_ns * 2, n=4)  # twice, since quantiles of a single step are undefined
    jitter = (upper_ns - lower_ns) / period_ns
    if jitter > JITTER_PERIODS:
        yield _warning(topic, f"has steps in time that vary by {100 * jitter:.0f} % (their middle half)")


def _coverage(log: LogReader, stamps_ns: dict[str, list[int]]) -> Iterator[Finding]:
    motion_ns = stamps_ns.get(topics.EGO_MOTION)
    if not motion_ns:
        yield _error(topics.EGO_MOTION, "has no message")
        return
    for camera in log.scene.cameras:
        frames_ns = stamps_ns.get(camera_topic(camera, topics.DISPARITY))
        if frames_ns and (frames_ns[0] < motion_ns[0] or frames_ns[-1] > motion_ns[-1]):
            yield _warning(topics.EGO_MOTION, f"does not cover the time of all frames of camera {camera}")


def _motion(samples: list[MotionSample]) -> Iterator[Finding]:
    for field, ((low, high), unit) in LIMITS.items():
        values = [getattr(sample, field) for sample in samples]
        worst = max(values, key=lambda value: max(low - value, value - high), default=0.0)
        if not low <= worst <= high:
            place = f"{topics.EGO_MOTION}: {field}"
            yield _error(place, f"{worst:g} {unit} is not within {low:g} to {high:g}")
    changes = [
        (after.speed_mps - before.speed_mps) * _NS_PER_S / (after.stamp_ns - before.stamp_ns)
        for before, after in pairwise(samples)
        if after.stamp_ns > before.stamp_ns
    ]
    worst = max(changes, key=abs, default=0.0)
    if not ACCELERATION_MPS2[0] <= worst <= ACCELERATION_MPS2[1]:
        yield _warning(f"{topics.EGO_MOTION}: speed_mps", f"changes by {worst:.0f} m/s within a second")


def _pictures(log: LogReader, camera: str) -> Generator[Finding, None, set[int]]:
    """Decode every label and disparity image and return the label ids; stop at the first broken one of a camera."""
    size: tuple[int, int] | None = None
    valid: list[float] = []
    label_ids: set[int] = set()
    for frame in log.frames(camera, images=True):
        try:
            size = _require_size(frame, size)
            valid.append(float((decode_gray(frame.disparity_png, bit_depth=16) > 0).mean()))
            if frame.label_png is not None:
                label_ids.update(np.unique(decode_gray(frame.label_png, bit_depth=8)).tolist())
        except InputError as error:
            yield _error(f"camera {camera}", f"picture at {frame.stamp_ns} ns: {error}")
            return label_ids
    if size is not None:
        yield from _calibration(log.calibration(camera), camera_topic(camera, topics.CALIBRATION), size)
    if valid and min(valid) < VALID_DISPARITY:
        message = f"one frame has a disparity at only {100 * min(valid):.1f} % of its pixels"
        yield _warning(camera_topic(camera, topics.DISPARITY), message)
    unknown = sorted(value for value in label_ids if value > _LAST_LABEL_ID)
    if unknown:
        message = f"holds {unknown[:5]}, which are not Cityscapes label ids (are they train ids?)"
        yield _warning(camera_topic(camera, topics.LABEL), message)
    return label_ids


def _require_size(frame: CameraFrame, size: tuple[int, int] | None) -> tuple[int, int]:
    """Return the size (width, height) of all pictures of a frame, that of the frames before if there were any."""
    for channel, png in (("disparity", frame.disparity_png), ("label", frame.label_png), ("image", frame.image_png)):
        if png is None:
            continue
        header = read_header(png)
        size = size or (header.width, header.height)
        if header[:2] != size:
            raise InputError(f"is {header.width} x {header.height}, not {size[0]} x {size[1]}", field=channel)
    assert size is not None
    return size


def _calibration(calibration: CameraCalibration, topic: str, size: tuple[int, int]) -> Iterator[Finding]:
    """Compare with what a road vehicle's stereo camera can plausibly be, for pictures of a size (width, height)."""
    plausible = {
        "fx_px / width": (calibration.fx_px / size[0], 0.2, 5.0),
        "fy_px / fx_px": (calibration.fy_px / calibration.fx_px, 0.9, 1.1),
        "u0_px / width": (calibration.u0_px / size[0], 0.2, 0.8),
        "v0_px / height": (calibration.v0_px / size[1], 0.2, 0.8),
        "baseline_m": (calibration.baseline_m, 0.03, 2.0),
        "z_m": (calibration.z_m, 0.3, 4.0),
        "roll_rad": (calibration.roll_rad, -0.5, 0.5),
        "pitch_rad": (calibration.pitch_rad, -0.5, 0.5),
    }
    for name, (value, low, high) in plausible.items():
        if not low <= value <= high:
            yield _warning(f"{topic}: {name}", f"{value:g} is not within {low:g} to {high:g}")
