"""What viewers show beside grids: grids as pictures for those that draw none, a legend, and the names of rows."""

import io
import math
from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from semgrid_eval.classes import MASK_COLOUR, ClassSet
from semgrid_eval.errors import printable
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log.codec import timestamp
from semgrid_eval.log.grids import GridLayer
from semgrid_eval.log.topics import GRID_FRAME
from semgrid_eval.recording.png import encode_gray, with_palette

Grid = NDArray[np.uint8]
_LINE_PX, _SWATCH_PX, _TEXT_PX, _EDGE_PX = 26, 18, 16, 10
_TEXT_M = 4.0  # height of a row's name beside its grid
_WIDTH_OF_LETTER = 0.6  # of its height
_BACKGROUND, _INK, _FRAME = (32, 32, 36), (235, 235, 235), (120, 120, 120)


def grid_picture(stamp_ns: int, values: Grid, layer: GridLayer, mask: Grid | None = None) -> CompressedImage:
    """Draw a grid (H, W), row 0 at the upper edge, in the colours of its layer, and the mask M in white."""
    palette = layer.rgba[:, :3].copy()
    if mask is not None:
        masked = len(layer.names)  # the id after those of all classes
        palette[masked] = MASK_COLOUR
        values = np.where(mask, np.uint8(masked), values)
    return picture_message(stamp_ns, with_palette(encode_gray(values), palette))


def legend(stamp_ns: int, rows: Sequence[str], classes: ClassSet) -> CompressedImage:
    """Draw which colour is which class, and which number is which row."""
    named = [(entry.name.replace("_", " "), entry.colour) for entry in classes.classes]
    numbered = [(f"{number}: {_drawable(row)}", _BACKGROUND) for number, row in enumerate(rows, start=1)]
    lines = [*named, ("left out of scores (M)", MASK_COLOUR), *numbered]
    font = ImageFont.load_default(_TEXT_PX)
    left_px = 2 * _EDGE_PX + _SWATCH_PX
    width_px = left_px + _EDGE_PX + math.ceil(max(font.getlength(text) for text, _ in lines))
    picture = Image.new("RGB", (width_px, 2 * _EDGE_PX + len(lines) * _LINE_PX), _BACKGROUND)
    draw = ImageDraw.Draw(picture)
    for place, (text, colour) in enumerate(lines):
        top_px, x_px = _EDGE_PX + place * _LINE_PX, _EDGE_PX
        if colour != _BACKGROUND:
            draw.rectangle((x_px, top_px, x_px + _SWATCH_PX, top_px + _SWATCH_PX), colour, _FRAME)
        draw.text((left_px if colour != _BACKGROUND else x_px, top_px), text, _INK, font)
    stream = io.BytesIO()
    picture.save(stream, "PNG")
    return picture_message(stamp_ns, stream.getvalue())


def row_name(stamp_ns: int, name: str, spec: GridSpec) -> SceneUpdate:
    """Write a row's name over the far edge of its grid, as text of the scene; it holds until another one comes."""
    text = printable(name)
    reach_m, across_m = spec.agent_row * spec.cell_m, spec.columns * spec.cell_m
    middle_m = (spec.agent_column - spec.columns / 2) * spec.cell_m
    size_m = min(_TEXT_M, across_m / (_WIDTH_OF_LETTER * len(text)))
    primitive = TextPrimitive(
        pose=Pose(
            position=Vector3(x=reach_m - size_m, y=middle_m, z=1.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
        ),
        billboard=True,
        font_size=size_m,
        color=Color(r=1.0, g=1.0, b=1.0, a=1.0),
        text=text,
    )
    entity = SceneEntity(timestamp=timestamp(stamp_ns), frame_id=GRID_FRAME, id="name", frame_locked=True)
    entity.texts.append(primitive)
    return SceneUpdate(entities=[entity])


def picture_message(stamp_ns: int, png: bytes, frame: str = GRID_FRAME) -> CompressedImage:
    """Return the message of a picture, a PNG file."""
    return CompressedImage(timestamp=timestamp(stamp_ns), frame_id=frame, data=png, format="png")


def _drawable(name: str) -> str:
    """Keep what any build of the font has."""
    return printable(name).encode("latin-1", "replace").decode("latin-1")
