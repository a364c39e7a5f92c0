"""Check a log: is it whole, can all its pictures be decoded, and does it hold what a contract expects?"""

from collections.abc import Generator, Iterator, Sequence
from functools import partial
from pathlib import Path

from semgrid_eval.errors import LogError
from semgrid_eval.executors import Executor, WorkerDied
from semgrid_eval.log import topics
from semgrid_eval.log.container import damage_as_log_error
from semgrid_eval.log.contract import Cameras, Contract, TopicContract, topics_of
from semgrid_eval.log.default_contract import default_contract
from semgrid_eval.log.findings import Finding, LogReport, Severity, bounded, error
from semgrid_eval.log.quantities import Extents, camera_extents, lidar_extents, motion_extents, truth_faults
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.stamps import stamp_of
from semgrid_eval.log.timing import Timeline, Times, coverage, judged, latencies, timing
from semgrid_eval.log.topics import camera_topic, lidar_topic
from semgrid_eval.progress import Progress, silent
from semgrid_eval.recording.types import Quantity

_NEEDED = (topics.DISPARITY, topics.CALIBRATION, topics.STEREO)
"""Channels of a camera without which its pictures cannot be looked at; a single camera has not the first."""
_TRUTH = {topics.TRUE_POSE, topics.TRUE_ACTORS}


def check_logs(
    paths: Sequence[Path], contract: Contract | None, executor: Executor, progress: Progress = silent
) -> list[LogReport]:
    """Check several logs side by side and return their reports in the same order."""
    reports: dict[int, LogReport] = {}
    for index, outcome in executor.run(partial(check_log, contract=contract), paths):
        reports[index] = _unread(paths[index], outcome) if isinstance(outcome, WorkerDied) else outcome
        progress(len(reports), len(paths), paths[index].name)
    return [reports[index] for index in range(len(paths))]


def _unread(path: Path, died: WorkerDied) -> LogReport:
    return LogReport(path, {}, 0.0, (error("file", died.reason),), {}, is_readable=False)


def check_log(path: Path, contract: Contract | None = None) -> LogReport:
    """Check one log against a contract, the default one if none is given; what is wrong is a finding, no exception."""
    findings: list[Finding] = []
    timeline: dict[str, list[Times]] = {}
    conditions: dict[str, Quantity] = {}
    expected = contract or default_contract()
    is_readable = True
    try:
        with LogReader(path) as log:
            log.verify()
            conditions = log.conditions()
            log.road_map()  # which reads all attachments
            cameras = _cameras(log)
            timeline = _timeline(log, expected, cameras)
            for finding in _findings(log, expected, timeline, cameras):  # one by one: those before damage count as well
                findings.append(finding)
    except LogError as fault:
        is_readable = False
        findings.append(error("file", str(fault).removeprefix(f"{path}: ")))
    counts = {topic: len(times) for topic, times in sorted(timeline.items())}
    told, more = bounded(findings)
    return LogReport(path, counts, _duration_s(timeline), told, conditions, is_readable, more)


def _duration_s(timeline: Timeline) -> float:
    times_ns = [each.log_ns for times in timeline.values() for each in times]
    return (max(times_ns) - min(times_ns)) / 1e9 if times_ns else 0.0


def _cameras(log: LogReader) -> Cameras:
    """Tell the cameras with disparity from those without; who does not say counts as one that has it."""

    def is_single(camera: str) -> bool:
        try:
            return log.is_single(camera)
        except LogError:
            return False

    single = tuple(filter(is_single, log.scene.cameras))
    return Cameras(tuple(camera for camera in log.scene.cameras if camera not in single), single)


def _timeline(log: LogReader, contract: Contract, cameras: Cameras) -> dict[str, list[Times]]:
    """Read the clocks of all messages, stamps only of topics that the contract asks for; this reads the whole file."""
    stamped = {name for each in contract.latencies for name in (each.topic, each.after or each.topic)}
    read = {topic for name in stamped for topic in topics_of(name, cameras).values()}
    schemas = log.schemas()
    found: dict[str, list[Times]] = {topic: [] for topic in schemas}
    for entry in log.messages():
        with damage_as_log_error(log.path):
            stamp_ns = stamp_of(schemas[entry.topic], entry.data) if entry.topic in read else None
        found[entry.topic].append(Times(entry.log_ns, entry.publish_ns, stamp_ns))
    log.require_count(sum(map(len, found.values())))
    return found


def _findings(log: LogReader, contract: Contract, timeline: Timeline, cameras: Cameras) -> Iterator[Finding]:
    if contract.checksums and not log.has_checksums:
        yield Finding(contract.checksums, "file", "has no checksums, so damage cannot be seen")
    if recovered := log.recovered():
        yield Finding(Severity.WARNING, "file", str(recovered))
    yield from judged(contract.cameras, "cameras", len(cameras.names), f"there are {len(cameras.names)}")
    sensors = len(cameras.names) + len(log.lidars) + bool(timeline.get(topics.TRUE_ACTORS))
    yield from judged(contract.sensors, "sensors", sensors, f"there are {sensors}")
    duration_s = _duration_s(timeline)
    yield from judged(contract.duration_s, "duration_s", duration_s, f"is {duration_s:g} s")
    wrong = log.wrong_types()
    yield from (error(f"{topic}: type", fault) for topic, fault in wrong.items())
    for name, expected in contract.topics.items():
        for camera, topic in topics_of(name, cameras).items():
            if topic not in wrong:
                yield from _type(topic, expected, log.schemas())
            yield from timing(topic, expected, timeline, camera)
            yield from coverage(topic, expected, timeline, cameras)
    yield from latencies(contract, timeline, cameras)
    extents = yield from _extents(log, timeline, cameras)
    yield from _values(contract, extents, cameras)


def _type(topic: str, expected: TopicContract, schemas: dict[str, str]) -> Iterator[Finding]:
    found = schemas.get(topic)
    if expected.type is not None and found is not None and found != expected.type:
        yield error(f"{topic}: type", f"holds {found or 'untyped'} messages; {expected.type} is needed")


def _extents(log: LogReader, timeline: Timeline, cameras: Cameras) -> Generator[Finding, None, Extents]:
    """Measure motion and cameras; what a camera lacks to be looked at is an error, whatever the contract says."""
    wrong = log.wrong_types()
    found = {} if topics.EGO_MOTION in wrong else motion_extents(log.motion())
    yield from () if wrong.keys() & _TRUTH else truth_faults(log)
    for camera in cameras.names:
        channels = _NEEDED[1:] if camera in cameras.single else _NEEDED
        needed = [camera_topic(camera, channel) for channel in channels]
        shown = {*needed, *(camera_topic(camera, channel) for channel in topics.PICTURE_FIELDS)}
        lacking = [topic for topic in needed if not timeline.get(topic)] + sorted(shown & wrong.keys())
        if lacking:
            yield error(f"camera {camera}", f"cannot be looked at without proper messages of {', '.join(lacking)}")
        else:
            found |= yield from camera_extents(log, camera)
    for lidar in (each for each in log.lidars if lidar_topic(each) not in wrong):
        found |= lidar_extents(log, lidar)
    return found


def _values(contract: Contract, extents: Extents, cameras: Cameras) -> Iterator[Finding]:
    for name, expected in contract.topics.items():
        for topic in topics_of(name, cameras).values():
            for quantity, limit in expected.values.items():
                extent = extents.get(topic, {}).get(quantity)
                if extent is None:
                    continue
                worst = extent.high if limit.holds(extent.low) else extent.low
                yield from judged(limit, f"{topic}: {quantity}", worst, f"is {worst:g}")
    ids = [
        extents[topic]["label_id"].high
        for camera in cameras.names
        if (topic := camera_topic(camera, topics.LABEL)) in extents
    ]
    if ids:
        text = f"the largest id is {max(ids):g}, so they look like train ids; convert again with --train-ids"
        yield from judged(contract.largest_label_id, "labels", max(ids), text)
