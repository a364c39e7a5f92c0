"""The extent of grids as their messages say it."""

from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log.grids import GridPlace
from semgrid_eval.log.predictions import GridExtent


def extent_of(spec: GridSpec) -> GridExtent:
    """Return size and place of grids: the vehicle's origin is that of the frame which messages are in."""
    place = GridPlace(spec.cell_m, spec.agent_row * spec.cell_m, spec.agent_column * spec.cell_m)
    return GridExtent(spec.rows, spec.columns, place)
