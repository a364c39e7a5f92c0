"""Small pictures of grids and labels, as data URIs that a page carries in itself, and the colours of classes."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.classes import MASK_COLOUR, NO_POINT, UNKNOWN, ClassSet
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.recording.png import decode_ids

Grid = NDArray[np.uint8]
PictureKind = Literal["camera", "labels", "grid"]
Words = tuple[str, str]
"""The title of a picture, and what it shows."""
Legend = tuple[tuple[str, str], ...]
"""Names and their colours."""

POINTLESS_COLOUR = (226, 232, 240)
HATCH_COLOUR = (0, 255, 255)
RIGHT_COLOURS = ((0, 0, 0), (128, 132, 138), (0, 114, 178), (230, 159, 0), (90, 60, 90), (255, 255, 255))
RIGHT_LABELS = ("unknown in all", "both right", "only the model right", "only the baseline right", "both wrong", "M")
SHARE_ENDS = ((255, 244, 214), (122, 4, 3))
"""Colours of no share and of the highest one."""
_CERTAINTY_LEVELS, _SHARE_LEVELS = 16, 15
_KEPT_PICTURES = 256
_SMALL_PALETTE = 16  # colours of a picture of four bits
_HATCH_SCALE, _HATCH_STEP = 3, 11  # pixels of an edge of a cell, and from line to line


def _hex(colour: tuple[int, int, int]) -> str:
    """Write a colour as CSS does."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


MASK_LEGEND = ("M (left out)", _hex(MASK_COLOUR))
POINTLESS_LEGEND = ("in no grid (sky, own vehicle)", _hex(POINTLESS_COLOUR))
HATCH_LEGEND = ("hatched: ground that no sensor of an input sees", _hex(HATCH_COLOUR))
RIGHT_LEGEND = tuple((name, _hex(colour)) for name, colour in zip(RIGHT_LABELS, RIGHT_COLOURS, strict=True))


@dataclass(frozen=True)
class Picture:
    """One picture of an example; its title tells it from others of the same moment."""

    title: str
    alt: str  # what it shows
    uri: str
    kind: PictureKind = "grid"
    lead: bool = True  # whether it is the one to show large
    colours: frozenset[int] = frozenset()  # which of `legend` appear in it


def class_legend(classes: ClassSet) -> Legend:
    """Return each class with its colour in whichever palette holds."""
    return tuple((name.replace("_", " "), f"var(--class-{i})") for i, name in enumerate(classes.names))


def legend(classes: ClassSet) -> Legend:
    """Return name and colour by class id, then of M, of what gives no point, and of hatching."""
    return (*class_legend(classes), MASK_LEGEND, POINTLESS_LEGEND, HATCH_LEGEND)


def hatched(classes: ClassSet) -> int:
    """Return the place of hatching in the legend."""
    return len(legend(classes)) - 1


def grid_picture(words: Words, grid: Grid, classes: ClassSet, *, lead: bool = True) -> Picture:
    """Draw a grid (H, W) in the colour-blind-safe class colours, which a page's reader may switch."""
    uri, colours = _in_class_colours(grid, classes)
    return Picture(*words, uri, "grid", lead, colours)


def masked_picture(words: Words, grid: Grid, mask: NDArray[np.bool_], classes: ClassSet) -> Picture:
    """Draw a grid (H, W) likewise, and mask M in white."""
    return grid_picture(words, Frame(grid, mask).shown(classes), classes)


@dataclass(frozen=True)
class Frame:
    """A grid (H, W) to be shown for a moment, with mask M in white."""

    grid: Grid
    mask: NDArray[np.bool_] | None = None

    def shown(self, classes: ClassSet) -> Grid:
        """Return the grid with its mask, in ids of the legend."""
        return self.grid if self.mask is None else np.where(self.mask, classes.count, self.grid).astype(np.uint8)


def strip_picture(title: str, frames: Sequence[Frame | None], classes: ClassSet) -> Picture:
    """Draw the grids of moments side by side, light gray where there is none."""
    shape = next((frame.grid.shape for frame in frames if frame is not None), (1, 1))
    nothing = np.full(shape, classes.count + 1, np.uint8)
    shown = [nothing if frame is None else frame.shown(classes) for frame in frames]
    return grid_picture((title, f"{title}, at each moment"), np.concatenate(shown, axis=1), classes)


def label_picture(words: Words, label: bytes, grid: GridConfig) -> Picture:
    """Make the picture of a label image, a PNG file of ids, in the colours of grids, what is in no grid in light gray.

    Raises:
        InputError: the file is damaged or too large.
    """
    seen = grid.class_by_label()[decode_ids(label)]
    shown = np.where(seen == NO_POINT, grid.classes.count + 1, seen).astype(np.uint8)
    uri, colours = _in_class_colours(shown, grid.classes)
    return Picture(*words, uri, "labels", colours=colours)


def hatch_png(cells: NDArray[np.bool_]) -> bytes:
    """Draw hatching and an outline over cells (H, W), to be laid over a grid; the rest is transparent."""
    inside = np.kron(cells, np.ones((_HATCH_SCALE, _HATCH_SCALE), np.bool_))
    around = np.pad(inside, 1)
    edge = inside & ~(around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:])
    rows, columns = np.indices(inside.shape)
    line = edge | (inside & ((rows + columns) % _HATCH_STEP == 0))
    return _png(line.astype(np.uint8), np.array([HATCH_COLOUR, HATCH_COLOUR], np.uint8), bits=1, clear=0)


def certainty_png(certainty: Grid, classes: int) -> bytes:
    """Draw certainty (H, W), 255 = 1.0, of one of so many classes, from dark (uncertain) to light (certain)."""
    levels = np.linspace(0, 1, _CERTAINTY_LEVELS)[:, None]
    palette = np.rint((1 - levels) * (13, 27, 62) + levels * (255, 236, 170)).astype(np.uint8)
    # A maximum over C classes lies between 1/C and 1; that range is what the colours are spread over.
    scaled = (certainty / 255 - 1 / classes) / (1 - 1 / classes) * (_CERTAINTY_LEVELS - 1)
    return _png(np.rint(scaled.clip(0, _CERTAINTY_LEVELS - 1)).astype(np.uint8), palette)


def share_png(shares: NDArray[np.float64]) -> bytes:
    """Draw shares (H, W) from 0, light, to 1, dark; NaN is transparent."""
    levels = np.linspace(0, 1, _SHARE_LEVELS)[:, None]
    palette = np.rint((1 - levels) * SHARE_ENDS[0] + levels * SHARE_ENDS[1]).astype(np.uint8)
    shown = np.where(np.isnan(shares), _SHARE_LEVELS, np.rint(np.nan_to_num(shares) * (_SHARE_LEVELS - 1)))
    return _png(shown.astype(np.uint8), np.vstack([palette, palette[:1]]), clear=_SHARE_LEVELS)


def right_png(target: Grid, prediction: Grid, baseline: Grid, mask: NDArray[np.bool_]) -> bytes:
    """Draw who is right in each cell, in `RIGHT_COLOURS`: (H, W) each."""
    mine, theirs = prediction == target, baseline == target
    shown = np.select([mask, mine & theirs & (target == UNKNOWN), mine & theirs, mine, theirs], [5, 0, 1, 2, 3], 4)
    return _png(shown.astype(np.uint8), np.array(RIGHT_COLOURS, np.uint8))


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """Encode a picture as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _in_class_colours(shown: Grid, classes: ClassSet) -> tuple[str, frozenset[int]]:
    """Draw ids (H, W) of a legend, and tell which of them there are."""
    palette = np.vstack([classes.palette(safe=True), np.array([MASK_COLOUR, POINTLESS_COLOUR], np.uint8)])
    bits = 4 if len(palette) <= _SMALL_PALETTE else 8
    return data_uri(_png(shown, palette, bits=bits)), frozenset(np.unique(shown).tolist())


def _png(indices: Grid, palette: NDArray[np.uint8], *, bits: int = 4, clear: int | None = None) -> bytes:
    return _encoded(indices.tobytes(), indices.shape, palette.tobytes(), bits, clear)


@lru_cache(maxsize=_KEPT_PICTURES)
def _encoded(indices: bytes, shape: tuple[int, int], palette: bytes, bits: int, clear: int | None) -> bytes:
    """Encode a picture; a page shows many of them several times."""
    picture = Image.frombytes("P", shape[::-1], indices)  # width, height
    picture.putpalette(palette)
    stream = io.BytesIO()
    transparent = {} if clear is None else {"transparency": clear}
    picture.save(stream, "PNG", bits=bits, optimize=True, **transparent)
    return stream.getvalue()


def class_style(classes: ClassSet) -> str:
    """Write both palettes as CSS: properties `--class-0`, ..., the paper's, or a set's own, for `data-colours=paper`.

    The page's script gives pictures the palette whose properties hold.
    """
    palettes = {":root": classes.palette(safe=True), ":root[data-colours=paper]": classes.palette()}
    return "".join(
        f"{selector}{{{';'.join(f'--class-{i}:{_hex(colour)}' for i, colour in enumerate(palette.tolist()))}}}"
        for selector, palette in palettes.items()
    )
