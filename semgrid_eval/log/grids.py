"""Bird's-eye grids as messages: coloured for viewers, exact for programs."""

from dataclasses import dataclass

import numpy as np
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from semgrid_eval.classes import MASK_COLOUR, UNKNOWN, ClassSet
from semgrid_eval.log.codec import timestamp
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid
from semgrid_eval.log.topics import GRID_FRAME

Values = NDArray[np.uint8]


@dataclass(frozen=True)
class GridPlace:
    """Where a grid is: edge of a cell, and the outer corner of cell (0, 0), ahead and left of the grid frame."""

    cell_m: float
    corner_x_m: float
    corner_y_m: float


@dataclass(frozen=True, eq=False)
class GridLayer:
    """What the values of a grid mean."""

    field: str  # name of the values
    rgba: Values  # (256, 4) sRGB and opacity by value
    names: tuple[str, ...] = ()  # by value


def _rgba(colours: NDArray[np.integer], first: int = 0) -> Values:
    """Return (256, 4): sRGB colours (N, 3), opaque, of the values from `first` on; all others are transparent."""
    rgba = np.zeros((256, 4), np.uint8)
    rgba[first : first + len(colours)] = np.insert(colours, 3, 255, axis=1)
    return rgba


def class_layer(classes: ClassSet) -> GridLayer:
    """Return the layer of class ids; unknown is transparent, so that it does not hide what a layer below it knows."""
    layer = GridLayer("class_id", _rgba(classes.palette()), classes.names)
    layer.rgba[UNKNOWN, 3] = 0
    return layer


MASK = GridLayer("masked", _rgba(np.array([MASK_COLOUR]), first=1), ("scored", "left_out"))
CERTAINTY = GridLayer("certainty", _rgba(np.repeat(np.arange(256)[:, None], 3, axis=1)))
"""Layers of grids: the mask M (1 = left out of scores), the highest score of a cell (255 = 1)."""


def viewer_message(stamp_ns: int, values: Values, layer: GridLayer, place: GridPlace) -> Grid:
    """Write a grid (H, W), row 0 farthest ahead and column 0 farthest left, coloured for viewers.

    A foxglove.Grid begins at the corner with the smallest x and y; its columns go along x, its rows along y.
    """
    rows, columns = values.shape
    along_x = values[::-1, ::-1].T  # (W, H): first row farthest right, first column nearest
    cells = np.concatenate([layer.rgba[along_x], along_x[..., None]], axis=-1)  # (W, H, 5)
    fields = ("red", "green", "blue", "alpha", layer.field)
    corner = Vector3(x=place.corner_x_m - rows * place.cell_m, y=place.corner_y_m - columns * place.cell_m, z=0.0)
    uint8 = PackedElementField.UINT8
    return Grid(
        timestamp=timestamp(stamp_ns),
        frame_id=GRID_FRAME,
        pose=Pose(position=corner, orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
        column_count=rows,
        cell_size=Vector2(x=place.cell_m, y=place.cell_m),
        row_stride=rows * len(fields),
        cell_stride=len(fields),
        fields=[PackedElementField(name=name, offset=offset, type=uint8) for offset, name in enumerate(fields)],
        data=cells.tobytes(),
    )


def exact_message(stamp_ns: int, values: Values, layer: GridLayer, place: GridPlace) -> SemanticGrid:
    """Write a grid (H, W) as it is scored."""
    rows, columns = values.shape
    return SemanticGrid(
        timestamp=timestamp(stamp_ns),
        frame_id=GRID_FRAME,
        rows=rows,
        columns=columns,
        cell_size_m=place.cell_m,
        corner_x_m=place.corner_x_m,
        corner_y_m=place.corner_y_m,
        class_ids=np.ascontiguousarray(values, np.uint8).tobytes(),
        class_names=layer.names,
    )
