"""PNG files that `tools/fuzz.py` changes, in their bytes or in their pixels."""

import random
import struct
import zlib
from pathlib import Path

import numpy as np
from support.fuzzing_texts import corpus
from support.fuzzing_ways import Inputs, changed_bytes

from semgrid_eval.labels import label_palette
from semgrid_eval.recording.png import decode_colour, decode_gray, decode_ids, encode_gray, require_pixels, with_palette


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
            body = repacked(body, chance) if kind == b"IDAT" and chance.random() < 0.7 else changed_bytes(body, chance)
        out += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        at += 12 + length
    return out if out != data else data + b"\0"


def repacked(body: bytes, chance: random.Random) -> bytes:
    """Change pixels, and pack them again."""
    try:
        return zlib.compress(changed_bytes(zlib.decompress(body), chance))
    except zlib.error:
        return changed_bytes(body, chance)
