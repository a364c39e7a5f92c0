"""Read the exact grids of a playback again."""

import numpy as np

from semgrid_eval.log.grids import GridPlace
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid


def read_exact(data):
    """Return the values (H, W) of an exact message, and where the grid is."""
    message = SemanticGrid.FromString(data)
    place = GridPlace(message.cell_size_m, message.corner_x_m, message.corner_y_m)
    return np.frombuffer(message.class_ids, np.uint8).reshape(message.rows, message.columns), place
