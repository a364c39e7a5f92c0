"""Colour images as logs hold them, the bytes of a PNG or JPEG file: kind, size and pixels."""

import io
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.errors import InputError
from semgrid_eval.recording import png

Kind = Literal["png", "jpeg"]
_JPEG = b"\xff\xd8\xff"
_JPEG_MODES = ("RGB", "L")
_DECODER_ERRORS = (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError)


class ImageSize(NamedTuple):
    """Size of an image in pixels."""

    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.width} x {self.height}"


def kind_of(data: bytes) -> Kind:
    """Tell by its first bytes what kind of file an image is; what is not JPEG counts as PNG."""
    return "jpeg" if data.startswith(_JPEG) else "png"


def read_size(data: bytes, path: Path | None = None) -> ImageSize:
    """Read the size of an image from its header; an InputError says that there is none, or that it is too large."""
    if kind_of(data) == "png":
        header = png.read_header(data, path)
        return ImageSize(header.width, header.height)
    try:
        with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
            size, mode = ImageSize(*picture.size), picture.mode
    except _DECODER_ERRORS as error:
        raise _damaged(error, path) from error
    if size.width * size.height > png.MAX_PIXELS:
        raise InputError(f"is {size}; at most {png.MAX_PIXELS} pixels are allowed", path=path)
    if mode not in _JPEG_MODES:
        raise InputError(f"is a JPEG file in {mode}; colour or gray is needed", path=path)
    return size


def require_whole(data: bytes, path: Path | None = None) -> ImageSize:
    """Read the size of an image, and make sure that all its pixels are there; errors as `read_size`."""
    if kind_of(data) == "png":
        header = png.require_pixels(data, path)
        return ImageSize(header.width, header.height)
    return ImageSize(*decode_colour(data, path).shape[1::-1])


def decode_colour(data: bytes, path: Path | None = None) -> NDArray[np.uint8]:
    """Decode an image of at most 8 bits a channel as RGB: (H, W, 3); gray is repeated, alpha left out."""
    if kind_of(data) == "png":
        return png.decode_colour(data, path)
    read_size(data, path)
    try:
        with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
            return np.array(picture.convert("RGB"), np.uint8)
    except _DECODER_ERRORS as error:
        raise _damaged(error, path) from error


def _damaged(error: Exception, path: Path | None) -> InputError:
    return InputError(f"is a damaged JPEG file: {error}", path=path)
