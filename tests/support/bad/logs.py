"""Bad logs of recordings."""

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from mcap.writer import Writer
from support.bad.case import Bad, Kind
from support.damage import CHUNK, flipped, stretches
from support.driving import driving
from support.single import single

from semgrid_eval.files import digest_value
from semgrid_eval.log import topics
from semgrid_eval.log.codec import PLAYBACK_RECORD, PREDICTIONS_RECORD
from semgrid_eval.log.schemas.egomotion_pb2 import Egomotion
from semgrid_eval.log.schemas.stereo_calibration_pb2 import StereoCalibration
from semgrid_eval.log.store import write_log
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import Moment, Recording

FOUND = Path(__file__).parents[2] / "corpus" / "log"
LOG, GRIDS = Path("logs/a.mcap"), "grids logs out --workers 1"
DISPARITY, CALIBRATION = (topics.camera_topic("front", each) for each in (topics.DISPARITY, topics.CALIBRATION))
LABEL, MOTION = topics.camera_topic("front", topics.LABEL), topics.EGO_MOTION
FOUND_WORDS = {
    "cut": "it is cut",
    "empty": "it is empty",
    "late": "times beyond 2^63 ns",
    "latest": "times of 2^64 - 1 ns",
    "magic_twice": "its first bytes alone, twice",
    "no_index": "no index",
    "of_another_program": "it is of another program",
    "text": "it is a text",
    "zeros": "it is nothing but zeros",
}
FOUND_BYTES = {words: (FOUND / f"{name}.mcap").read_bytes() for name, words in FOUND_WORDS.items()}


def _moments() -> Iterator[Moment]:
    """Move on with all pictures in every frame."""
    full = next(driving(size=(32, 16)).moments()).cameras["front"]
    for moment in driving(frames=4).moments():
        sample = replace(moment.motion[0], speed_mps=8.0, yaw_rate_radps=0.1)
        yield replace(moment, motion=(sample,), cameras={"front": replace(full, stamp_ns=moment.stamp_ns)})


def _whole() -> Recording:
    return replace(driving(), moments=_moments)


def whole() -> None:
    """Write a good log of four frames."""
    write_log(_whole(), LOG)


Message = Callable[[str, bytes], bytes | None]


def as_it_is(topic: str, data: bytes) -> bytes | None:
    """Change no message."""
    return data


def again(message: Message = as_it_is, scene: dict[str, str] | None = None, **changes: object) -> None:
    """Write the log again with checksums that hold: other messages, another record, other times or types."""
    content = LOG.read_bytes()
    with LOG.open("rb") as old, LOG.with_suffix(".new").open("wb") as stream:
        writer = Writer(stream, enable_data_crcs=True)
        writer.start(profile="", library="")
        copy(make_reader(old), writer, message, scene, changes)
        writer.finish()
    LOG.with_suffix(".new").rename(LOG)
    assert LOG.read_bytes() != content


def copy(
    reader: object, writer: Writer, message: Message, scene: dict[str, str] | None, changes: dict[str, Any]
) -> None:
    """Copy a log: messages as `message` changes them, what `scene` puts into records, other types of topics."""
    for record in reader.iter_metadata():
        writer.add_metadata(record.name, _sealed(record.metadata | (scene or {})))
    for each in reader.iter_attachments():
        writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, each.data)
    channels: dict[str, int] = {}
    for schema, channel, found in reader.iter_messages():
        if (data := message(channel.topic, found.data)) is None:
            continue
        if channel.topic not in channels:
            name = changes.get("types", {}).get(channel.topic, schema.name)
            number = writer.register_schema(name, schema.encoding, schema.data)
            channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, number)
        writer.add_message(channels[channel.topic], found.log_time, data, found.publish_time)


def _sealed(entries: dict[str, str]) -> dict[str, str]:
    given = {key: value for key, value in entries.items() if key != "digest" and value is not None}
    return {**given, "digest": digest_value(given)} if "digest" in entries else given


def _without(*gone: str) -> Message:
    return lambda topic, data: None if topic in gone else data


def _broken(topic: str, data: bytes) -> Message:
    return lambda name, old: data if name == topic else old


def _decoded(topic: str, kind: type, **values: object) -> Message:
    def change(name: str, data: bytes) -> bytes:
        if name != topic:
            return data
        message = kind.FromString(data)
        for field, value in values.items():
            setattr(message, field, value)
        return message.SerializeToString()

    return change


def _frames(change: Callable[[Moment], Moment], **more: object) -> None:
    write_log(replace(driving(), moments=lambda: map(change, _moments()), **more), LOG)


def _pictures(**pictures: object) -> None:
    """Write the log again with other pictures in every frame."""
    _frames(lambda moment: replace(moment, cameras={"front": replace(moment.cameras["front"], **pictures)}))


def _flip() -> None:
    data = LOG.read_bytes()
    LOG.write_bytes(flipped(data, next(each for each in stretches(data) if each.opcode == CHUNK).end - 30))


def _unsealed() -> None:
    """Write the log again with a record whose digest does not hold."""
    data = LOG.read_bytes()
    assert data.count(b"synthetic") == 1
    LOG.write_bytes(data.replace(b"synthetic", b"sYnthetic"))


def _truth_alone() -> None:
    write_log(single(_whole()), LOG)
    again(_without(LABEL, topics.camera_topic("front", topics.IMAGE)))


def _other_camera(folder: str) -> None:
    write_log(driving(cameras=("front", "rear"), frames=3, size=(32, 16)), Path(folder, "a.mcap"))


def _log(words: str, spoil: Callable[[], object], command: str = GRIDS) -> Bad:
    return Bad(words, command, spoil=spoil)


LATENCY = "latency logs --out latency.json --frames 1 --warm-up 0 --threads 1 --device cpu"
SMALL = encode_gray(np.zeros((8, 8), np.uint8))
SPEED = {"speed_mps": 1e6}
KIND = Kind(
    "Logs",
    f"A log `{LOG}` of `{GRIDS}`, or of the command that is named.",
    whole,
    (
        *(Bad(words, GRIDS, {str(LOG): content}) for words, content in FOUND_BYTES.items()),
        _log("a flipped byte", _flip),
        _log("a flipped byte in its record", _unsealed),
        _log("another version of its format", lambda: again(scene={"format_version": "99"})),
        _log("no name in its record", lambda: again(scene={"name": None})),
        _log("a name that leads out of its folder", lambda: again(scene={"name": "../a"})),
        _log("a split that is no name of a folder", lambda: again(scene={"split": "a/b"})),
        _log("cameras that are no list", lambda: again(scene={"cameras": "front"})),
        _log("a camera that it has nothing of", lambda: again(scene={"cameras": '["side"]'})),
        _log("no calibration", lambda: again(_without(CALIBRATION))),
        _log("a calibration that cannot be decoded", lambda: again(_broken(CALIBRATION, b"\xff\xff"))),
        _log(
            "a baseline of 0",
            lambda: again(_decoded(topics.camera_topic("front", topics.STEREO), StereoCalibration, baseline_m=0.0)),
        ),
        _log("no disparity", lambda: again(_without(DISPARITY))),
        _log("a camera without disparity alone", lambda: write_log(single(_whole()), LOG)),
        _log("no labels", lambda: again(_without(LABEL))),
        _log("no motion", lambda: again(_without(MOTION))),
        _log("motion that cannot be decoded", lambda: again(_broken(MOTION, b"\xff\xff"))),
        _log("a speed of 1,000,000 m/s", lambda: again(_decoded(MOTION, Egomotion, **SPEED))),
        _log("a speed that is not a number", lambda: again(_decoded(MOTION, Egomotion, speed_mps=float("nan")))),
        _log("a yaw rate of 9 rad/s", lambda: again(_decoded(MOTION, Egomotion, yaw_rate_radps=9.0))),
        _log("a label image that cannot be decoded", lambda: again(_broken(LABEL, b"\xff\xff"))),
        _log("messages of another type", lambda: again(types={DISPARITY: "foxglove.Grid"}), "check logs"),
        _log("labels of another type", lambda: again(types={LABEL: "foxglove.RawImage"})),
        _log("motion of another type", lambda: again(types={MOTION: "foxglove.PoseInFrame"})),
        _log("a true actor at no finite place", lambda: _actors(x_m=float("nan")), "check logs"),
        _log("a run that `play` wrote", lambda: _other_kind(PLAYBACK_RECORD), "check logs"),
        _log("predictions", lambda: _other_kind(PREDICTIONS_RECORD)),
        _log("a label image of another size", lambda: _pictures(label_png=SMALL), "check logs"),
        _log("a camera of which there is the truth alone", _truth_alone, "check logs"),
        _log("a disparity image of 8 bit", lambda: again(_png(DISPARITY, encode_gray(np.zeros((16, 32), np.uint8))))),
        _log("a label image that is cut", lambda: again(_png(LABEL, SMALL[:-20]))),
        _log("two cameras, none of them named", lambda: _other_camera("logs")),
        _log("a camera that it does not have", lambda: _grid_of("rear"), f"{GRIDS} --config grid.yaml"),
        _log(
            "two logs of one recording",
            lambda: shutil.copy(LOG, "logs/b.mcap"),
            "run baselines --logs logs --out out --workers 1 --device cpu --row BL-DC",
        ),
        _log(
            "two logs of one name to recover",
            lambda: (Path("more").mkdir(), shutil.copy(LOG, "more")),
            "check logs more --recover out",
        ),
        _log(
            "an earlier recovery in OUT",
            lambda: (Path("out").mkdir(), shutil.copy(LOG, "out")),
            "check logs --recover out",
        ),
        _log("`latency`: a camera without disparity", lambda: write_log(single(_whole()), LOG), LATENCY),
        _log("`latency`: no motion", lambda: again(_without(MOTION)), LATENCY),
        _log("`latency`: no labels", lambda: again(_without(LABEL)), LATENCY),
        _log("`latency --right`: an image too few", lambda: _right(3), f"{LATENCY} --right right"),
        _log("`latency --right`: images of another size", lambda: _right(4), f"{LATENCY} --right right"),
        _log("no log in the folder", LOG.unlink),
        _log("a folder that is called like a log", lambda: (LOG.unlink(), LOG.mkdir())),
    ),
)


def _actors(**values: object) -> None:
    """Write the log again with other true actors."""
    _frames(lambda moment: replace(moment, actors=tuple(replace(actor, **values) for actor in moment.actors)))


def _other_kind(record: str) -> None:
    with LOG.open("wb") as stream, MessageWriter(stream) as writer:
        writer.metadata(record, {"recording": "street"})


def _png(topic: str, png: bytes) -> Message:
    return _decoded(topic, CompressedImage, data=png)


def _grid_of(camera: str) -> None:
    Path("grid.yaml").write_text(json.dumps({"sensors": {"full": {"camera": camera}}}))


def _right(count: int) -> None:
    Path("right/street").mkdir(parents=True)
    for number in range(count):
        Path(f"right/street/{number}.png").write_bytes(SMALL)
