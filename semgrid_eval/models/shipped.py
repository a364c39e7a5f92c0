"""The residual network that comes with the package, trained on the simulated town (docs/model-card.md)."""

from importlib import resources
from pathlib import Path

import torch
from torch import Tensor

from semgrid_eval.classes import DEFAULT_CLASSES
from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.models.checkpoint import load_weights, read_header
from semgrid_eval.models.model import Given, Model
from semgrid_eval.models.residual import Residual, ResidualSettings
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.words import plural

WEIGHTS = Path("data") / "residual-town-v1.safetensors"
CELL_M = 100 / 128
LEAD_LIMIT_S = 1.25
_INPUTS = 2


class TownResidual(Model, torch.nn.Module):
    """RN-town: told the lead, so that it answers any from 1 to 20 frames of the town, .06 to 1.2 s."""

    words = "residual network trained on the simulated town, told the lead"
    family = "RN"
    files = ()
    leads_s = (1 / 17, LEAD_LIMIT_S)
    version = "be616bd1"  # of the weights: the first digits of their file's SHA-256

    def __init__(self, settings: Config, given: Given) -> None:
        super().__init__(settings, given)
        with resources.as_file(resources.files("semgrid_eval") / WEIGHTS.as_posix()) as path:
            built = parse_config(ResidualSettings, read_header(path)["settings"], path=path)
            self.network = Residual(built, given)
            load_weights(self.network, path)

    @classmethod
    def check(cls, settings: Config, given: Given) -> None:
        """Refuse what it was not trained on.

        That is one sensor, two inputs moved to the target's time, and the paper's cells and classes.
        """
        if given.grids != _INPUTS or given.inputs != _INPUTS:
            asked = f"{plural(len(given.sensors), 'sensor')} and {plural(given.inputs, 'input')}"
            raise ConfigError(f"was trained on {_INPUTS} inputs of one sensor, not {asked}", field="model")
        if not given.classes.means(DEFAULT_CLASSES):
            names = ", ".join(given.classes.names)
            raise ConfigError(f"was trained on the default classes, and grid.classes has {names}", field="model")
        if not given.translate:
            raise ConfigError(
                "was trained on inputs moved to the target's time, which translate: false leaves out", field="model"
            )
        if abs(given.cell_m - CELL_M) > 0.01 * CELL_M:
            raise ConfigError(f"was trained on cells of {CELL_M:g} m, not {given.cell_m:g} m", field="model")

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return class probabilities: (B, C, H, W).

        Raises:
            InputError: a window asks for a longer lead than it was trained on.
        """
        longest_s = float(batch.lead_s[:, -1].max())
        if longest_s > LEAD_LIMIT_S:
            raise InputError(f"was trained on leads up to {LEAD_LIMIT_S:g} s, not {longest_s:.2f} s", field="model")
        return self.network.predict(batch)
