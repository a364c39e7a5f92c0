"""Small PNG pictures of grids, as data URIs that a page carries in itself."""

import base64
import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.classes import CLASS_COUNT, MASK_COLOUR, class_palette
from semgrid_eval.report.colours import class_colours, hex_colour

Grid = NDArray[np.uint8]

MASKED = CLASS_COUNT
RIGHT_COLOURS = ((0, 0, 0), (128, 132, 138), (0, 114, 178), (230, 159, 0), (90, 60, 90), (255, 255, 255))
RIGHT_LABELS = ("unknown in all", "both right", "only the model right", "only the baseline right", "both wrong", "M")
_CERTAINTY_LEVELS = 16

CLASS_LEGEND = class_colours()
MASK_LEGEND = ("M (left out)", hex_colour(MASK_COLOUR))
RIGHT_LEGEND = tuple((name, hex_colour(colour)) for name, colour in zip(RIGHT_LABELS, RIGHT_COLOURS, strict=True))


def grid_png(grid: Grid, mask: NDArray[np.bool_] | None = None) -> bytes:
    """Draw a grid in the colour-blind-safe class colours, which a page's reader may switch, M in white: (H, W)."""
    shown = grid if mask is None else np.where(mask, MASKED, grid).astype(np.uint8)
    return _png(shown, np.vstack([class_palette(safe=True), np.array([MASK_COLOUR], np.uint8)]))


def certainty_png(certainty: Grid) -> bytes:
    """Draw certainty (H, W), 255 = 1.0, from dark (uncertain) to light (certain)."""
    levels = np.linspace(0, 1, _CERTAINTY_LEVELS)[:, None]
    palette = np.rint((1 - levels) * (13, 27, 62) + levels * (255, 236, 170)).astype(np.uint8)
    # A maximum over C classes lies between 1/C and 1; that range is what the colours are spread over.
    scaled = (certainty / 255 - 1 / CLASS_COUNT) / (1 - 1 / CLASS_COUNT) * (_CERTAINTY_LEVELS - 1)
    return _png(np.rint(scaled.clip(0, _CERTAINTY_LEVELS - 1)).astype(np.uint8), palette)


def right_png(target: Grid, prediction: Grid, baseline: Grid, mask: NDArray[np.bool_]) -> bytes:
    """Draw who is right in each cell, in `RIGHT_COLOURS`: (H, W) each."""
    mine, theirs = prediction == target, baseline == target
    shown = np.select([mask, mine & theirs & (target == 0), mine & theirs, mine, theirs], [5, 0, 1, 2, 3], 4)
    return _png(shown.astype(np.uint8), np.array(RIGHT_COLOURS, np.uint8))


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """Encode a picture as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _png(indices: Grid, palette: NDArray[np.uint8]) -> bytes:
    height, width = indices.shape
    picture = Image.frombytes("P", (width, height), indices.tobytes())
    picture.putpalette(palette.tobytes())
    stream = io.BytesIO()
    picture.save(stream, "PNG", bits=4, optimize=True)
    return stream.getvalue()
