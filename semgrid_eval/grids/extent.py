"""The extent of grids as their messages say it."""

from semgrid_eval.classes import ClassSet
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log.grids import GridPlace
from semgrid_eval.log.predictions import GridExtent


def extent_of(spec: GridSpec, classes: ClassSet) -> GridExtent:
    """Return size, place and classes of grids: the vehicle's origin is that of the frame which messages are in."""
    return GridExtent(spec.rows, spec.columns, place_of(spec), classes)


def place_of(spec: GridSpec) -> GridPlace:
    """Return where grids lie."""
    return GridPlace(spec.cell_m, spec.agent_row * spec.cell_m, spec.agent_column * spec.cell_m)
