"""Models for tests: made with what a row would give them."""

from semgrid_eval.config import parse_config
from semgrid_eval.models.model import Given, Model
from semgrid_eval.models.network import Network, seeded_network


def given(*, sensors=("full",), inputs=2, size=16, cell_m=1.0, translate=True) -> Given:
    """What a row with square grids gives its model."""
    return Given(tuple(sensors), inputs, size, size, cell_m, translate)


def made(model: type[Model], row=None, **settings) -> Model:
    """Make a model with these settings; `row` is what the row gives."""
    return model(parse_config(model.Settings, settings), row or given())


def network(model: type[Network], row=None, seed=0, **settings) -> Network:
    """Make an untrained network with these settings."""
    return seeded_network(model, parse_config(model.Settings, settings), row or given(), seed)
