"""Logs that `tools/fuzz.py` changes: read, recovered, and changed in what they say while their checksums hold."""

import io
import json
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer
from support import damage
from support.driving import driving
from support.fuzzing_ways import Inputs, changed_bytes
from support.single import single
from support.swept import sweep

from semgrid_eval.files import digest_value
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.recover import recover_log
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.types import Moment, Quantity, Recording


def log_inputs(folder: Path) -> dict[str, bytes]:
    two = driving(frames=2, cameras=("front", "rear"), size=(8, 8))
    recordings = {
        "small": driving(frames=2, size=(16, 8)),
        "two": two,
        "single": swept(single(two, "rear")),
        "long": driving(frames=6, size=(8, 8)),
    }
    conditions = {"noise": Quantity(0.31, "px"), "count": Quantity(3, "")}
    for name, recording in recordings.items():
        write_log(replace(recording, conditions=conditions), folder / f"{name}.mcap")
    return {f"{name}.mcap": (folder / f"{name}.mcap").read_bytes() for name in recordings}


def swept(recording: Recording) -> Recording:
    """Put a LiDAR beside the cameras, whose points are labelled."""

    def moments() -> Iterator[Moment]:
        for moment in recording.moments():
            points = sweep(moment.stamp_ns, [(8.0, 1.0, -1.0), (20.0, -4.0, 0.5)], ["road", "car"])
            yield replace(moment, sweeps={"top": points})

    return replace(recording, moments=moments)


def read_log(folder: Path, name: str) -> object:
    """All that the reader gives; a check finds every damage, in lines."""
    report = check_log(folder / name)
    lines = [str(finding) for finding in report.findings]
    json.dumps(report.to_json(), allow_nan=False)
    assert not any("\n" in line for line in lines)
    with LogReader(folder / name) as log:
        cameras = {
            camera: (log.calibration(camera), list(log.frames(camera, images=True))) for camera in log.scene.cameras
        }
        told = (log.scene, log.conditions(), log.attachments(), log.motion(), log.poses(), list(log.actors()))
        return told, cameras, [comparable(moment) for moment in log.moments()], report.good


def comparable(moment: Moment) -> tuple[Moment, list[object]]:
    """Sweeps are equal if their arrays are."""
    arrays = [
        (
            name,
            each.stamp_ns,
            each.mount,
            *(array.tobytes() for array in (each.points_m, each.intensity, each.label_id)),
        )
        for name, each in sorted(moment.sweeps.items())
    ]
    return replace(moment, sweeps={}), arrays


def log_agrees(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    """What is read is what was written, and the check has seen the damage."""
    return found[:3] == expected[:3] and not found[3]


def recovered(folder: Path, name: str) -> object:
    out = folder / "out" / name
    out.unlink(missing_ok=True)
    found = recover_log(folder / name, out)
    list(found.lines())
    json.dumps(found.to_json(), allow_nan=False)
    check_log(out)
    return found, out.read_bytes()


def recovery_agrees(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    """Nothing is saved that was not there or more often than it was, and nothing whole is left out or untold."""
    recovery, new = found
    written = [message[1:] for held in damage.messages(whole).values() for message in held]
    saved = [message[1:] for held in damage.messages(new).values() for message in held]
    if not set(saved) <= set(written):
        return False
    if len(whole) != len(data) or recovery.is_whole:
        return True
    untold = sum(each.count for loss in recovery.losses if "topic" in loss.reason for each in loss.messages or ())
    return len(damage.untouched(whole, data)) <= len(saved) + untold <= len(written)


def resealed(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change what a log says, not how it is written: all its checksums hold."""
    out, odd = io.BytesIO(), chance.choice((0.02, 0.2))
    writer = Writer(out, chunk_size=chance.choice((64, 4096, 1 << 20)), enable_data_crcs=True)

    def changed(data: bytes) -> bytes:
        return changed_bytes(data, chance) if chance.random() < odd else data

    def text(word: str) -> str:
        return changed(word.encode()).decode("utf-8", "replace")

    def time(stamp_ns: int) -> int:
        return chance.choice((0, (1 << 63) - 1, (1 << 64) - 1, stamp_ns + 1)) if chance.random() < odd / 4 else stamp_ns

    writer.start(profile="", library="")
    reader = make_reader(io.BytesIO(inputs[name]))
    for record in reader.iter_metadata():
        writer.add_metadata(
            record.name, sealed_scene({text(key): text(value) for key, value in record.metadata.items()})
        )
    channels = {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if channel.id not in channels:
            number = writer.register_schema(text(schema.name), schema.encoding, schema.data)
            channels[channel.id] = writer.register_channel(text(channel.topic), channel.message_encoding, number)
        if chance.random() > odd / 2:
            times = time(message.log_time), changed(message.data), time(message.publish_time)
            writer.add_message(channels[channel.id], *times)
    writer.finish()
    return out.getvalue()


def sealed_scene(entries: dict[str, str]) -> dict[str, str]:
    """Make the digest of a scene's record hold; other records have none."""
    given = {key: value for key, value in entries.items() if key != "digest"}
    return {**given, "digest": digest_value(given)} if "digest" in entries else given
