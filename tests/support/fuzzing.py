"""What `tools/fuzz.py` mutates: whole inputs of each kind, how they are changed, what reads them and must agree."""

import io
import json
import random
import re
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer
from support import damage
from support.bad import cityscapes, contracts, matrices, yaml_files
from support.cityscapes_tree import CAMERA
from support.driving import driving
from support.fuzzing_bags import bag_inputs, read_bag
from support.mutations import KINDS as KEPT
from support.mutations import make_run

from semgrid_eval.classes import label_palette
from semgrid_eval.config import load_yaml
from semgrid_eval.files import digest_value
from semgrid_eval.log.check import check_log
from semgrid_eval.log.contract import contract_text, load_contract
from semgrid_eval.log.default_contract import default_contract
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.recover import recover_log
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.png import decode_colour, decode_gray, decode_ids, encode_gray, require_pixels, with_palette
from semgrid_eval.recording.types import Quantity
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.sources.cityscapes.files import read_camera, read_stamp, read_vehicle

Inputs = Mapping[str, bytes]
CORPUS: dict[str, Mapping[str, bytes]] = {
    "camera": cityscapes.CAMERA_BYTES,
    "contract": contracts.CONTENTS,
    "matrix": matrices.FILE_BYTES | matrices.ROW_BYTES | matrices.STREAM_BYTES,
    "png": cityscapes.PNG_BYTES,
    "timestamp": cityscapes.STAMPS,
    "vehicle": cityscapes.VEHICLE_BYTES,
    "yaml": yaml_files.CONTENTS,
}
"""Inputs that are bad, by kind and words."""
READERS: dict[str, Callable[[Path], object]] = {
    "camera": read_camera,
    "contract": load_contract,
    "matrix": lambda path: load_matrix(str(path)),
    "timestamp": read_stamp,
    "vehicle": lambda path: read_vehicle(path, 0),
    "yaml": load_yaml,
}
PRESETS = Path(__file__).parents[2] / "semgrid_eval" / "presets"


def same(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    return found == expected


def never(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    """No change may be accepted."""
    return False


@dataclass(frozen=True)
class Kind:
    """One kind of input, by names of files below a folder."""

    inputs: Callable[[Path], dict[str, bytes]]
    read: Callable[[Path, str], object]
    mutate: Callable[[Inputs, str, random.Random], bytes]
    has_checksums: bool = True
    agrees: Callable[[bytes, bytes, object, object], bool] = same

    def put(self, folder: Path, name: str, data: bytes) -> None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def anyhow(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change some bytes, stretches, or the length."""
    data = inputs[name]
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        data = chance.choice(WAYS)(data, chance)
    return data


def _flip(data: bytes, chance: random.Random) -> bytes:
    if not data:
        return b"\0"
    at = chance.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]


def _stretch(data: bytes, chance: random.Random) -> tuple[int, int]:
    at = chance.randint(0, len(data))
    return at, min(at + chance.choice((1, 4, 8, 64, 512, 4096)), len(data))


def _fill(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    filling = chance.choice((b"\0", b"\xff", b"")) * (end - at) or chance.randbytes(end - at)
    return data[:at] + filling + data[end:]


def _cut(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randint(0, len(data))]


def _drop(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    return data[:at] + data[end:]


def _double(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    return data[:end] + data[at:]


def _number(data: bytes, chance: random.Random) -> bytes:
    """Write a number that breaks sums over some bytes."""
    size = chance.choice((1, 2, 4, 8))
    value = chance.choice((0, 1, (1 << 8 * size) - 1, 1 << (8 * size - 1), (1 << (8 * size - 1)) - 1))
    at = chance.randint(0, max(len(data) - size, 0))
    return data[:at] + value.to_bytes(size, chance.choice(("little", "big"))) + data[at + size :]


def _more(data: bytes, chance: random.Random) -> bytes:
    return data + chance.randbytes(chance.randint(1, 64))


WAYS = (_flip, _flip, _flip, _fill, _fill, _cut, _drop, _double, _number, _number, _more)


def words(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change text: as any bytes, or a word of it for another that means something to a parser."""
    if chance.random() < 0.4:
        return anyhow(inputs, name, chance)
    parts = re.split(r"(\w+|[^\w\s])", inputs[name].decode("utf-8", "replace"))
    for _ in range(chance.choice((1, 1, 2, 4))):
        parts[chance.randrange(len(parts))] = chance.choice((*WORDS, chance.choice(parts)))
    return "".join(parts).encode("utf-8", "surrogatepass")


WORDS = (
    *(
        "0",
        "-1",
        "1e999",
        "nan",
        "NaN",
        "Infinity",
        "9" * 30,
        "9" * 5000,
        "0x1f",
        "010",
        "1.5",
        "true",
        "null",
        "''",
        "~",
    ),
    *(
        "[",
        "]",
        "{",
        "}",
        ":",
        ",",
        "-",
        "\n",
        "\t",
        "  ",
        "#",
        "&a",
        "*a",
        "!!int",
        "<<",
        "|",
        ">",
        "%",
        "\0",
        "\ud800",
    ),
    *(
        '"',
        "\\u0000",
        "\\ud800",
        "é",
        "\u202e",
        "[" * 3000,
        "{camera}",
        "../..",
        "/dev/zero",
        "x" * 400,
        "a.py:B",
        "none",
    ),
)


def log_inputs(folder: Path) -> dict[str, bytes]:
    made = {}
    for name, options in (
        ("small", {"frames": 2, "size": (16, 8)}),
        ("two", {"frames": 2, "cameras": ("front", "rear"), "size": (8, 8)}),
        ("long", {"frames": 6, "size": (8, 8)}),
    ):
        recording = replace(driving(**options), conditions={"noise": Quantity(0.31, "px"), "count": Quantity(3, "")})
        write_log(recording, folder / f"{name}.mcap")
        made[f"{name}.mcap"] = (folder / f"{name}.mcap").read_bytes()
    return made


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
        return told, cameras, list(log.moments()), report.good


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
        return _changed(data, chance) if chance.random() < odd else data

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


def png_inputs(folder: Path) -> dict[str, bytes]:
    rng = np.random.default_rng(5)
    label = encode_gray(rng.integers(0, 34, (9, 12), np.uint8))
    made = {"label": label, "palette": with_palette(label, label_palette())}
    made["disparity"] = encode_gray(rng.integers(0, 1 << 16, (9, 12), np.uint16))
    return made


def read_png(folder: Path, name: str) -> object:
    data = (folder / name).read_bytes()
    header = require_pixels(data)
    if header.bit_depth == 16:
        return header, decode_gray(data, bit_depth=16).tobytes()
    return header, decode_ids(data).tobytes(), decode_gray(data, bit_depth=8).tobytes(), decode_colour(data).tobytes()


def all_png_inputs(folder: Path) -> dict[str, bytes]:
    return png_inputs(folder) | corpus("png")


def resealed_png(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change chunks of a PNG file, and make their checksums hold."""
    data, at, out = inputs[name], 8, inputs[name][:8]
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        if chance.random() < 0.4:
            body = repacked(body, chance) if kind == b"IDAT" and chance.random() < 0.7 else _changed(body, chance)
        out += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        at += 12 + length
    return out if out != data else data + b"\0"


def repacked(body: bytes, chance: random.Random) -> bytes:
    """Change pixels, and pack them again."""
    try:
        return zlib.compress(_changed(zlib.decompress(body), chance))
    except zlib.error:
        return _changed(body, chance)


def _changed(data: bytes, chance: random.Random) -> bytes:
    return anyhow({"": data}, "", chance)


def json_inputs(folder: Path) -> dict[str, bytes]:
    vehicle = {"speed": 5.5, "yawRate": 0.1, "gpsLatitude": 49.1, "gpsLongitude": 8.2, "gpsHeading": None}
    made = {"camera/whole": json.dumps(CAMERA).encode(), "vehicle/whole": json.dumps(vehicle).encode()}
    return made | {"timestamp/whole": b"17000\n"} | corpus("camera", "vehicle", "timestamp")


def yaml_inputs(folder: Path) -> dict[str, bytes]:
    made = {"contract/default.yaml": contract_text(default_contract()).encode()}
    made |= {f"matrix/{path.name}": path.read_bytes() for path in PRESETS.glob("*.yaml")}
    bad = corpus("contract", "matrix", "yaml")
    return made | dict(list(bad.items())[::8])  # most that is made of what is bad is bad, too


def read_of_kind(folder: Path, name: str) -> object:
    return READERS[name.partition("/")[0]](folder / name)


def corpus(*kinds: str) -> dict[str, bytes]:
    """Bad inputs by kind and number, those that are bad by their size alone left out."""
    found = {kind: [data for data in CORPUS[kind].values() if len(data) < 1 << 15] for kind in kinds}
    return {f"{kind}/{number}": data for kind in kinds for number, data in enumerate(found[kind])}


def kept_inputs(kind: str, folder: Path) -> dict[str, bytes]:
    run = make_run(folder) if not (folder / "run").exists() else folder / "run"
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(run.glob(KEPT[kind][0]))}


def read_kept(kind: str, owners: dict[str, str], folder: Path, name: str) -> object:
    path = folder / name
    if name not in owners:  # it is whole when it is read first
        owners[name] = re.findall(rb"semgrid-eval seal (\S+) ", path.read_bytes())[-1].decode()
    KEPT[kind][1](path, owners[name])
    return True


def or_another(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change a file, or put another of its kind in its place."""
    others = [data for data in inputs.values() if data != inputs[name]]
    return chance.choice(others) if others and chance.random() < 0.1 else anyhow(inputs, name, chance)


def _kept(kind: str) -> Kind:
    return Kind(partial(kept_inputs, kind), partial(read_kept, kind, {}), or_another, agrees=never)


KINDS: dict[str, Kind] = {
    "log": Kind(log_inputs, read_log, anyhow, agrees=log_agrees),
    "recovery": Kind(log_inputs, recovered, anyhow, agrees=recovery_agrees),
    "resealed log": Kind(log_inputs, read_log, resealed, has_checksums=False),
    "png": Kind(png_inputs, read_png, anyhow),
    "resealed png": Kind(all_png_inputs, read_png, resealed_png, has_checksums=False),
    "json": Kind(json_inputs, read_of_kind, words, has_checksums=False),
    "yaml": Kind(yaml_inputs, read_of_kind, words, has_checksums=False),
    "bag": Kind(bag_inputs, read_bag, anyhow, has_checksums=False),
    **{kind: _kept(kind) for kind in KEPT},
}
