import io
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from semgrid_eval.errors import InputError
from semgrid_eval.labels import label_palette
from semgrid_eval.recording.png import (
    MAX_PIXELS,
    decode_colour,
    decode_gray,
    decode_ids,
    encode_gray,
    read_header,
    require_pixels,
    with_palette,
)

SHAPES = arrays.array_shapes(min_dims=2, max_dims=2, max_side=40)
GRAY_8 = arrays.arrays(np.uint8, SHAPES)
GRAY_16 = arrays.arrays(np.uint16, SHAPES)


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(width: int, height: int, depth: int, colour_type: int, *middle: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + b"".join(middle) + chunk(b"IEND", b"")


def packed_rows(rows: list[str]) -> bytes:
    """Rows as strings of bits, each a multiple of eight, as one IDAT chunk."""
    lines = (b"\0" + int(row, 2).to_bytes(len(row) // 8, "big") for row in rows)
    return chunk(b"IDAT", zlib.compress(b"".join(lines)))


@given(GRAY_8)
def test_gray_of_8_bits_comes_back_as_it_went_in_for_every_decoder(picture):
    data = encode_gray(picture)
    assert np.array_equal(decode_gray(data, bit_depth=8), picture)
    assert np.array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), picture)


@given(GRAY_16)
def test_gray_of_16_bits_comes_back_as_it_went_in_for_every_decoder(picture):
    data = encode_gray(picture)
    decoded = decode_gray(data, bit_depth=16)
    assert decoded.dtype == np.uint16
    assert np.array_equal(decoded, picture)
    assert np.array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), picture)


def test_header_tells_size_depth_and_kind():
    header = read_header(encode_gray(np.zeros((3, 5), np.uint16)))
    assert header == (5, 3, 16, 0)
    assert str(header) == "5 x 3, 16 bit, gray"


@given(GRAY_8)
def test_palette_keeps_pixels_and_shows_colours(picture):
    data = with_palette(encode_gray(picture), label_palette())
    assert read_header(data).colour_type == 3
    assert np.array_equal(decode_gray(data, bit_depth=8), picture)
    shown = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
    assert np.array_equal(shown, label_palette()[picture])


def test_palette_leaves_compressed_pixels_as_they_are():
    pixels = chunk(b"IDAT", zlib.compress(bytes(12), level=0))
    data = png(3, 3, 8, 0, chunk(b"tEXt", b"a\0b"), pixels[:-4] + pixels[-4:])
    assert pixels in with_palette(data, label_palette())


def test_palette_replaces_another_palette():
    picture = np.arange(6, dtype=np.uint8).reshape(2, 3)
    other = with_palette(encode_gray(picture), np.full((256, 3), 7, np.uint8))
    assert with_palette(other, label_palette()) == with_palette(encode_gray(picture), label_palette())


@pytest.mark.parametrize("colour_type", [0, 3])
@pytest.mark.parametrize(
    ("depth", "row", "expected"),
    [
        (1, "01101000", [0, 1, 1]),
        (2, "00011011", [0, 1, 2]),
        (4, "0000100111110000", [0, 9, 15]),
        (8, "0" * 24, [0] * 3),
    ],
)
def test_ids_of_few_bits_are_read_exactly(colour_type, depth, row, expected):
    palette = [chunk(b"PLTE", bytes(3 * (1 << depth)))] if colour_type == 3 else []
    data = png(3, 1, depth, colour_type, *palette, packed_rows([row]))
    assert decode_ids(data).tolist() == [expected]


def test_ids_of_16_bits_and_colours_are_refused():
    with pytest.raises(InputError, match=r"labels\.png: is 4 x 4, 16 bit, gray; ids of at most 8 bits"):
        decode_ids(encode_gray(np.zeros((4, 4), np.uint16)), "labels.png")
    colour = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()
    with pytest.raises(InputError, match="8 bit, colour"):
        decode_ids(colour)
    with pytest.raises(InputError, match="8 bit, colour; 8 bit gray is needed"):
        with_palette(colour, label_palette())


@pytest.mark.parametrize(("wanted", "given_type"), [(8, np.uint16), (16, np.uint8)])
def test_another_bit_depth_is_refused(wanted, given_type):
    with pytest.raises(InputError, match=f"{wanted} bit gray is needed"):
        decode_gray(encode_gray(np.zeros((4, 4), given_type)), bit_depth=wanted)


def test_size_is_bounded_before_anything_is_decoded():
    side = int(MAX_PIXELS**0.5)
    pixels = chunk(b"IDAT", b"")
    with pytest.raises(InputError, match="pixels are allowed"):
        read_header(png(side + 1, side, 8, 0, pixels))
    with pytest.raises(InputError, match="pixels are allowed"):
        read_header(png(0, 5, 8, 0, pixels))
    assert read_header(png(side, side, 8, 0, pixels)).width == side


def test_a_second_header_is_refused_before_anything_is_decoded():
    small, large = (struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0) for side in (3, 50_000))
    data = png(3, 3, 8, 0, chunk(b"IHDR", large), chunk(b"IDAT", zlib.compress(bytes(12))))
    again = png(3, 3, 8, 0, chunk(b"IDAT", zlib.compress(bytes(12))), chunk(b"IHDR", small))
    for each in (data, again):
        with pytest.raises(InputError, match=r"twice\.png: is a damaged PNG file: it has 2 headers"):
            decode_gray(each, bit_depth=8, path="twice.png")


def test_what_pillow_holds_for_too_large_is_an_error_of_the_file(monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 4)
    with pytest.raises(InputError, match=r"large\.png: is a damaged PNG file: Image size \(9 pixels\) exceeds"):
        decode_gray(encode_gray(np.zeros((3, 3), np.uint8)), bit_depth=8, path="large.png")


@pytest.mark.parametrize("data", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n", png(1, 1, 8, 0)[:8] + png(1, 1, 8, 0)[33:]])
def test_what_is_no_png_is_refused(data):
    with pytest.raises(InputError, match="PNG"):
        read_header(data)


def test_every_cut_is_seen():
    data = encode_gray(np.arange(20, dtype=np.uint8).reshape(4, 5))
    for length in range(len(data)):
        with pytest.raises(InputError):
            read_header(data[:length])


@given(st.data())
def test_every_flipped_bit_is_seen(data):
    whole = bytearray(encode_gray(np.arange(20, dtype=np.uint8).reshape(4, 5)))
    whole[data.draw(st.integers(0, len(whole) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(InputError):
        read_header(bytes(whole))


@pytest.mark.parametrize("pixels", [zlib.compress(bytes(5)), b"no zlib at all", b"", zlib.compress(b"\x09" * 12)])
def test_pixels_that_cannot_be_decoded_are_an_error_even_if_checksums_fit(pixels):
    with pytest.raises(InputError, match="damaged PNG"):
        decode_gray(png(3, 3, 8, 0, chunk(b"IDAT", pixels)), bit_depth=8)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
def test_colour_pictures_of_every_kind_come_out_as_rgb(mode):
    colours = np.array([[[255, 0, 0], [0, 0, 255], [51, 51, 51]], [[255, 255, 0], [0, 255, 0], [0, 0, 0]]], np.uint8)
    stream = io.BytesIO()
    Image.fromarray(colours).convert(mode).save(stream, "PNG")
    assert decode_colour(stream.getvalue()).tolist() == colours.tolist()


def test_gray_pictures_come_out_as_equal_channels():
    assert decode_colour(encode_gray(np.array([[7, 200]], np.uint8))).tolist() == [[[7, 7, 7], [200, 200, 200]]]


def test_colour_pictures_of_16_bits_are_refused():
    with pytest.raises(InputError, match="at most 8 bits a channel are needed"):
        decode_colour(encode_gray(np.zeros((2, 2), np.uint16)))


def with_pixels(header: tuple[int, ...], packed: bytes) -> bytes:
    return b"".join(
        [b"\x89PNG\r\n\x1a\n", chunk(b"IHDR", struct.pack(">IIBBBBB", *header)), chunk(b"IDAT", packed)]
    ) + chunk(b"IEND", b"")


LINES = b"".join(bytes([0, *range(5)]) for _ in range(4))  # 5 x 4 pixels of 8 bits
SOUND = (5, 4, 8, 0, 0, 0, 0)


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA", "LA", "I;16"])
@pytest.mark.parametrize("size", [(1, 1), (3, 9), (17, 5)])
def test_all_pixels_of_whole_pictures_are_there(mode, size):
    stream = io.BytesIO()
    Image.new(mode, size).save(stream, "PNG")
    assert require_pixels(stream.getvalue())[:2] == size


@pytest.mark.parametrize("size", [(1, 1), (5, 4), (9, 8), (2, 17)])
def test_all_pixels_of_interlaced_pictures_are_there(size):
    firsts = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    lines = [
        bytes(1 + len(range(x, size[0], across)))
        for x, y, across, down in firsts
        for _ in range(y, size[1], down)
        if range(x, size[0], across)
    ]
    data = with_pixels((*size, 8, 0, 0, 0, 1), zlib.compress(b"".join(lines)))
    assert require_pixels(data)[:2] == size
    assert Image.open(io.BytesIO(data)).size == size


@pytest.mark.parametrize(
    ("header", "packed", "message"),
    [
        (SOUND, zlib.compress(LINES[:-1]), "too few pixels"),
        (SOUND, zlib.compress(LINES)[:-6], "too few pixels|do not end"),
        (SOUND, zlib.compress(LINES + b"1"), "do not end where they should"),
        (SOUND, zlib.compress(LINES)[:-1], "do not end where they should"),
        (SOUND, zlib.compress(LINES)[:-1] + b"1", "incorrect data check"),
        (SOUND, zlib.compress(b"\x05" + LINES[1:]), "a line of pixels begins wrongly"),
        ((5, 4, 8, 0, 0, 0, 1), zlib.compress(LINES), "pixels"),
        ((5, 4, 8, 0, 0, 0, 2), zlib.compress(LINES), "its header is impossible"),
        ((5, 4, 8, 0, 1, 0, 0), zlib.compress(LINES), "its header is impossible"),
        ((5, 4, 4, 2, 0, 0, 0), zlib.compress(LINES), "its header is impossible"),
        (SOUND, b"junk", "incorrect header check"),
    ],
)
def test_pictures_whose_chunks_are_sound_and_whose_pixels_are_not_are_refused(header, packed, message):
    require_pixels(with_pixels(SOUND, zlib.compress(LINES)))
    with pytest.raises(InputError, match=f"is a damaged PNG file: .*({message})"):
        require_pixels(with_pixels(header, packed))


def test_pixels_that_would_fill_the_memory_are_not_unpacked():
    bomb = zlib.compress(bytes(1 << 24))
    with pytest.raises(InputError, match="do not end where they should"):
        require_pixels(with_pixels((1, 1, 8, 0, 0, 0, 0), bomb))
