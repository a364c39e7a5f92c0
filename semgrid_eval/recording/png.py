"""PNG files as bytes: read headers, decode gray and palette pictures, add palettes to label images without decoding.

A `path` is where the bytes come from, for the InputError that is raised where they are damaged or not what is needed.
"""

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.errors import InputError

MAX_PIXELS = 1 << 26  # 8192 x 8192
GRAY, PALETTE = 0, 3
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER = struct.Struct(">IIBBBBB")
_CHUNK_OVERHEAD_BYTES = 12  # length, type and CRC
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_LAST_FILTER = 4
# Of interlaced pictures: first column and row of each pass, and the steps between columns and rows.
_ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
_COLOUR_TYPES = {0: "gray", 2: "colour", 3: "palette", 4: "gray with alpha", 6: "colour with alpha"}
_DECODER_ERRORS = (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error, Image.DecompressionBombError)


class PngHeader(NamedTuple):
    """What a PNG file says of its picture; `colour_type` as in the PNG specification (0 gray, 2 RGB, 3 palette)."""

    width: int
    height: int
    bit_depth: int
    colour_type: int

    def __str__(self) -> str:
        kind = _COLOUR_TYPES.get(self.colour_type, f"colour type {self.colour_type}")
        return f"{self.width} x {self.height}, {self.bit_depth} bit, {kind}"


class _Chunk(NamedTuple):
    kind: bytes
    start: int  # of the whole chunk, its length field included
    end: int


def read_header(data: bytes, path: Path | None = None) -> PngHeader:
    """Read the header of a PNG file; make sure that the file is whole, has one header and a size within bounds."""
    chunks = list(_chunks(data, path))
    kinds = [chunk.kind for chunk in chunks]
    if kinds[:1] != [b"IHDR"] or chunks[0].end - chunks[0].start != _HEADER.size + _CHUNK_OVERHEAD_BYTES:
        raise InputError("is not a PNG file: it does not begin with a header", path=path)
    if kinds[-1] != b"IEND" or b"IDAT" not in kinds:
        raise InputError("is a damaged PNG file: it ends early", path=path)
    if kinds.count(b"IHDR") > 1:  # decoders may obey another one than the one whose size is checked here
        raise InputError(f"is a damaged PNG file: it has {kinds.count(b'IHDR')} headers", path=path)
    header = PngHeader(*_HEADER.unpack_from(data, chunks[0].start + 8)[:4])
    if not 0 < header.width * header.height <= MAX_PIXELS:
        raise InputError(f"is {header}; 1 to {MAX_PIXELS} pixels are allowed", path=path)
    return header


def require_pixels(data: bytes, path: Path | None = None) -> PngHeader:
    """Read the header of a PNG file, and make sure that all its pixels are there, as `read_header` does for the file.

    The compressed pixels have a checksum of their own, which decoders do not look at.
    """
    header = read_header(data, path)
    fault = _fault_of_pixels(data)
    if fault:
        raise InputError(f"is a damaged PNG file: {fault}", path=path)
    return header


@lru_cache(maxsize=8)  # who finds a file looks at it, and again who writes it to a log
def _fault_of_pixels(data: bytes) -> str:
    """Say what is wrong with the pixels of a file whose header and chunks are sound; empty where nothing is."""
    chunks = list(_chunks(data, None))
    width, height, depth, colour, *methods, interlace = _HEADER.unpack_from(data, chunks[0].start + 8)
    if depth not in _DEPTHS.get(colour, ()) or any(methods) or interlace > 1:
        return "its header is impossible"
    bits = depth * _CHANNELS[colour]
    passes = _ADAM7 if interlace else ((0, 0, 1, 1),)
    sizes = [(-(-(width - x) // across), -(-(height - y) // down)) for x, y, across, down in passes]
    lines = [(1 + (columns * bits + 7) // 8, rows) for columns, rows in sizes if columns > 0 < rows]
    total = sum(length * rows for length, rows in lines)
    stream = zlib.decompressobj()
    try:
        packed = b"".join(data[chunk.start + 8 : chunk.end - 4] for chunk in chunks if chunk.kind == b"IDAT")
        pixels = stream.decompress(packed, total)
        more = stream.decompress(stream.unconsumed_tail, 1)
    except zlib.error as error:
        return f"its pixels cannot be unpacked ({str(error).rpartition(': ')[2]})"
    if len(pixels) != total or more or not stream.eof:
        return "it has too few pixels" if len(pixels) < total else "its pixels do not end where they should"
    return "" if _filters(pixels, lines) <= _LAST_FILTER else "a line of pixels begins wrongly"


def _filters(pixels: bytes, lines: Sequence[tuple[int, int]]) -> int:
    """Return the highest number of a filter, with which each line begins; of each length there are so many lines."""
    highest, start = 0, 0
    for length, rows in lines:
        highest = max(highest, *pixels[start : start + length * rows : length])
        start += length * rows
    return highest


def decode_gray(data: bytes, *, bit_depth: int, path: Path | None = None) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Decode a gray picture, or the indices of a palette picture, of 8 or 16 bits exactly: (H, W) uint8 or uint16."""
    header = read_header(data, path)
    if header.bit_depth != bit_depth or header.colour_type not in (GRAY, PALETTE):
        raise InputError(f"is {header}; {bit_depth} bit gray is needed", path=path)
    pixels = _pixels(data, path)
    return pixels.astype(np.uint8, copy=False) if bit_depth == 8 else pixels.astype(np.uint16, copy=False)


def decode_ids(data: bytes, path: Path | None = None) -> NDArray[np.uint8]:
    """Decode ids of at most 8 bits from a gray or palette picture: (H, W)."""
    header = read_header(data, path)
    if header.bit_depth > 8 or header.colour_type not in (GRAY, PALETTE):
        raise InputError(f"is {header}; ids of at most 8 bits are needed, gray or palette", path=path)
    ids = _pixels(data, path).astype(np.uint8, copy=False)
    if header.colour_type == GRAY and header.bit_depth in (2, 4):
        ids //= np.uint8(255 // ((1 << header.bit_depth) - 1))  # Pillow spreads such gray over 0..255
    return ids


def decode_colour(data: bytes, path: Path | None = None) -> NDArray[np.uint8]:
    """Decode a picture of at most 8 bits a channel as RGB: (H, W, 3); gray is repeated, alpha left out."""
    header = read_header(data, path)
    if header.bit_depth > 8:
        raise InputError(f"is {header}; at most 8 bits a channel are needed", path=path)
    return _pixels(data, path, mode="RGB").astype(np.uint8, copy=False)


def encode_gray(picture: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode a picture (H, W), uint8 or uint16, as a gray PNG file."""
    assert picture.ndim == 2
    assert picture.dtype in (np.uint8, np.uint16)
    return encode(picture)


def encode(picture: NDArray[np.uint8] | NDArray[np.uint16], parameters: Sequence[int] = ()) -> bytes:
    """Encode a picture (H, W), or (H, W, 3) in OpenCV's order BGR, as a PNG file with parameters of OpenCV."""
    done, data = cv2.imencode(".png", picture, parameters)
    assert done, "OpenCV encodes every 8 or 16 bit image"
    return data.tobytes()


def with_palette(data: bytes, palette: NDArray[np.uint8], path: Path | None = None) -> bytes:
    """Turn an 8-bit gray or palette PNG file into one of an sRGB palette (256, 3), its compressed pixels untouched."""
    header = read_header(data, path)
    if header.bit_depth != 8 or header.colour_type not in (GRAY, PALETTE):
        raise InputError(f"is {header}; 8 bit gray is needed", path=path)
    chunks = list(_chunks(data, path))
    fields = bytearray(data[chunks[0].start + 8 : chunks[0].end - 4])
    fields[9] = PALETTE
    kept = b"".join(data[chunk.start : chunk.end] for chunk in chunks if chunk.kind in (b"IDAT", b"IEND"))
    return _SIGNATURE + _pack(b"IHDR", bytes(fields)) + _pack(b"PLTE", palette.tobytes()) + kept


def _pixels(data: bytes, path: Path | None, *, mode: str | None = None) -> NDArray[np.generic]:
    # Pillow gives the indices of a palette picture, where OpenCV gives colours, and was as fast for both kinds.
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            return np.array(picture if mode is None else picture.convert(mode))
    except _DECODER_ERRORS as error:
        raise InputError(f"is a damaged PNG file: {error}", path=path) from error


def _pack(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def _chunks(data: bytes, path: Path | None) -> Iterator[_Chunk]:
    """Walk over the chunks up to IEND, holding each one's checksum against its bytes."""
    if not data.startswith(_SIGNATURE):
        raise InputError("is not a PNG file", path=path)
    view = memoryview(data)
    start = len(_SIGNATURE)
    kind = b""
    while kind != b"IEND":
        end = start + _CHUNK_OVERHEAD_BYTES + int.from_bytes(view[start : start + 4], "big")
        if end > len(data):
            raise InputError("is a damaged PNG file: it ends early", path=path)
        kind = bytes(view[start + 4 : start + 8])
        if zlib.crc32(view[start + 4 : end - 4]) != int.from_bytes(view[end - 4 : end], "big"):
            raise InputError("is a damaged PNG file: a checksum is wrong", path=path)
        yield _Chunk(kind, start, end)
        start = end
