"""Pictures in messages: raw images as arrays, compressed ones as the files they hold."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.recording.colour import decode_colour, kind_of, read_size
from semgrid_eval.recording.png import decode_gray, decode_ids, encode

Pixels = NDArray[np.uint8]
_TO_BGR = {
    "bgr8": None,
    "rgb8": cv2.COLOR_RGB2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR,
    "mono8": None,
}
_FORMATS: dict[str, tuple[str, int]] = {  # type of a number, and how many a pixel has
    **dict.fromkeys(("bgr8", "rgb8"), ("u1", 3)),
    **dict.fromkeys(("bgra8", "rgba8"), ("u1", 4)),
    **dict.fromkeys(("mono8", "8UC1"), ("u1", 1)),
    **dict.fromkeys(("16UC1", "mono16"), ("u2", 1)),
    "32FC1": ("f4", 1),
}
_CODINGS = {
    **dict.fromkeys(("image", "right"), (*_TO_BGR, "png", "jpeg")),
    "depth": ("16UC1", "mono16", "32FC1", "png"),
    "disparity": ("32FC1",),
    "labels": ("mono8", "8UC1", "png"),
}
_DEPTH_HEADER_BYTES = 12  # of compressedDepth, before its PNG file
_MM = np.float32(0.001)


@dataclass(frozen=True)
class Shape:
    """How the pixels of a picture are coded, and its size."""

    coding: str  # the encoding of a raw image, `png` or `jpeg`
    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.coding} of {self.width} x {self.height}"


def shape_of(message: Any) -> Shape:  # noqa: ANN401 - a class that rosbags makes
    """Return what an Image or CompressedImage says of itself, undecoded."""
    if hasattr(message, "encoding"):
        return Shape(str(message.encoding), message.width, message.height)
    data = _file(message)
    return Shape(kind_of(data), *read_size(data))


def require_coding(use: str, coding: str) -> None:
    """Make sure that a picture can be read as what the map uses it as.

    Raises:
        InputError: its coding is none of those that are read.
    """
    if coding in _CODINGS[use]:
        return
    advice = f"{use} is read from {', '.join(_CODINGS[use])}"
    if coding.startswith("bayer"):
        advice = "record what image_proc makes of it (image_color or image_rect_color)"
    if coding == "jpeg":
        advice = f"JPEG changes values, so {use} is read from {', '.join(_CODINGS[use])}"
    raise InputError(f"is {coding}; {advice}")


def colour_file(message: Any) -> bytes:  # noqa: ANN401
    """Return a colour or gray image as a file: a compressed one untouched, a raw one as PNG."""
    if hasattr(message, "encoding"):
        return encode(colour(message))
    return _file(message)


def colour(message: Any) -> Pixels:  # noqa: ANN401
    """Return a colour image in OpenCV's order BGR (H, W, 3), or a gray one (H, W) where the message is mono8."""
    if not hasattr(message, "encoding"):
        return np.ascontiguousarray(decode_colour(_file(message))[..., ::-1])
    pixels = _raw(message).astype(np.uint8, copy=False)
    code = _TO_BGR[message.encoding]
    return pixels if code is None else np.asarray(cv2.cvtColor(pixels, code), np.uint8)


def gray(picture: Pixels) -> Pixels:
    """Make a picture (H, W, 3) gray (H, W); a gray one stays what it is."""
    return picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


def depth_m(message: Any) -> NDArray[np.float32]:  # noqa: ANN401
    """Return the depth along the optical axis (H, W) in metres; 0, infinity or NaN where there is none."""
    if not hasattr(message, "encoding"):
        return decode_gray(_file(message), bit_depth=16).astype(np.float32) * _MM
    pixels = _raw(message).astype(np.float32)
    return pixels if message.encoding == "32FC1" else pixels * _MM


def floats(message: Any) -> NDArray[np.float32]:  # noqa: ANN401
    """Return the picture of a 32FC1 message (H, W)."""
    return _raw(message).astype(np.float32)


def ids_of(message: Any) -> Pixels:  # noqa: ANN401
    """Return the ids in a label image (H, W)."""
    if not hasattr(message, "encoding"):
        return decode_ids(_file(message))
    return _raw(message).astype(np.uint8, copy=False)


def _raw(message: Any) -> NDArray[np.generic]:  # noqa: ANN401
    """Return the pixels of a raw image (H, W) or (H, W, C), whatever its lines end with."""
    number, channels = _FORMATS[message.encoding]
    kind = np.dtype(number).newbyteorder(">" if message.is_bigendian else "<")
    line = message.width * channels * kind.itemsize
    data = np.asarray(message.data, np.uint8)
    if message.step < line or len(data) != message.step * message.height:
        size = f"{message.width} x {message.height} of {message.encoding}"
        raise InputError(f"{len(data)} bytes in lines of {message.step} are not {size}", field="data")
    pixels = np.ascontiguousarray(data.reshape(message.height, message.step)[:, :line]).view(kind)
    return pixels.reshape(message.height, message.width, channels) if channels > 1 else pixels


def _file(message: Any) -> bytes:  # noqa: ANN401
    """Return the file in a compressed image."""
    data = bytes(message.data)
    if "compressedDepth" not in message.format:
        return data
    if "16UC1" not in message.format:
        raise InputError(f"{message.format!r} is not read; record 16UC1 depth, or the raw image", field="format")
    return data[_DEPTH_HEADER_BYTES:]
