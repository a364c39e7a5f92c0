"""Small pictures of grids and labels, as data URIs that a page carries in itself."""

import base64
import io
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.classes import CLASS_COUNT, MASK_COLOUR, NO_POINT, UNKNOWN, class_palette
from semgrid_eval.recording.png import decode_ids
from semgrid_eval.report.page.colours import class_colours, hex_colour

Grid = NDArray[np.uint8]

MASKED, POINTLESS, HATCHED = CLASS_COUNT, CLASS_COUNT + 1, CLASS_COUNT + 2
POINTLESS_COLOUR = (226, 232, 240)
HATCH_COLOUR = (0, 255, 255)
RIGHT_COLOURS = ((0, 0, 0), (128, 132, 138), (0, 114, 178), (230, 159, 0), (90, 60, 90), (255, 255, 255))
RIGHT_LABELS = ("unknown in all", "both right", "only the model right", "only the baseline right", "both wrong", "M")
_CERTAINTY_LEVELS = 16
_HATCH_SCALE, _HATCH_STEP = 3, 11  # pixels of an edge of a cell, and from line to line

CLASS_LEGEND = class_colours()
MASK_LEGEND = ("M (left out)", hex_colour(MASK_COLOUR))
POINTLESS_LEGEND = ("in no grid (sky, own vehicle)", hex_colour(POINTLESS_COLOUR))
HATCH_LEGEND = ("hatched: ground that no sensor of an input sees", hex_colour(HATCH_COLOUR))
LEGEND = (*CLASS_LEGEND, MASK_LEGEND, POINTLESS_LEGEND, HATCH_LEGEND)
"""Name and colour by class id, then by `MASKED`, `POINTLESS` and `HATCHED`."""
RIGHT_LEGEND = tuple((name, hex_colour(colour)) for name, colour in zip(RIGHT_LABELS, RIGHT_COLOURS, strict=True))


@dataclass(frozen=True)
class Picture:
    """One picture of an example.

    Args:
        title: tells it from others of the same moment.
        alt: what it shows, as its alternative text.
        uri: its data URI.
        kind: `camera`, `labels` or `grid`.
        lead: whether it is the one to show large.
        colours: which of `LEGEND` appear in it.
    """

    title: str
    alt: str
    uri: str
    kind: Literal["camera", "labels", "grid"] = "grid"
    lead: bool = True
    colours: frozenset[int] = frozenset()


def grid_picture(
    title: str, alt: str, grid: Grid, mask: NDArray[np.bool_] | None = None, *, lead: bool = True
) -> Picture:
    """Make the picture of a grid (H, W), mask M in white."""
    there = np.unique(grid if mask is None else np.where(mask, MASKED, grid)).tolist()
    return Picture(title, alt, data_uri(grid_png(grid, mask)), lead=lead, colours=frozenset(there))


def grid_png(grid: Grid, mask: NDArray[np.bool_] | None = None) -> bytes:
    """Draw a grid in the colour-blind-safe class colours, which a page's reader may switch, M in white: (H, W)."""
    shown = grid if mask is None else np.where(mask, MASKED, grid).astype(np.uint8)
    return _png(shown, _class_palette())


def label_picture(title: str, alt: str, label: bytes, class_by_label: Grid) -> Picture:
    """Make the picture of a label image, a PNG file of ids, in the colours of grids, what is in no grid in light gray.

    Raises:
        InputError: the file is damaged or too large.
    """
    classes = class_by_label[decode_ids(label)]
    shown = np.where(classes == NO_POINT, POINTLESS, classes).astype(np.uint8)
    there = np.unique(shown).tolist()
    return Picture(title, alt, data_uri(_png(shown, _class_palette())), "labels", colours=frozenset(there))


def hatch_png(cells: NDArray[np.bool_]) -> bytes:
    """Draw hatching and an outline over cells (H, W), to be laid over a grid; the rest is transparent."""
    inside = np.kron(cells, np.ones((_HATCH_SCALE, _HATCH_SCALE), np.bool_))
    around = np.pad(inside, 1)
    edge = inside & ~(around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:])
    rows, columns = np.indices(inside.shape)
    line = edge | (inside & ((rows + columns) % _HATCH_STEP == 0))
    return _png(line.astype(np.uint8), np.array([HATCH_COLOUR, HATCH_COLOUR], np.uint8), bits=1, clear=0)


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
    shown = np.select([mask, mine & theirs & (target == UNKNOWN), mine & theirs, mine, theirs], [5, 0, 1, 2, 3], 4)
    return _png(shown.astype(np.uint8), np.array(RIGHT_COLOURS, np.uint8))


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """Encode a picture as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _class_palette() -> Grid:
    return np.vstack([class_palette(safe=True), np.array([MASK_COLOUR, POINTLESS_COLOUR], np.uint8)])


def _png(indices: Grid, palette: NDArray[np.uint8], *, bits: int = 4, clear: int | None = None) -> bytes:
    height, width = indices.shape
    picture = Image.frombytes("P", (width, height), indices.tobytes())
    picture.putpalette(palette.tobytes())
    stream = io.BytesIO()
    transparent = {} if clear is None else {"transparency": clear}
    picture.save(stream, "PNG", bits=bits, optimize=True, **transparent)
    return stream.getvalue()
