"""Models whose time is taken: with their own weights where they have some, else made for that alone."""

from collections.abc import Callable
from dataclasses import dataclass

import torch

from semgrid_eval.errors import InputError
from semgrid_eval.models.model import Given, Model
from semgrid_eval.models.network import Network, seeded_network
from semgrid_eval.models.registry import find_model
from semgrid_eval.windows.data import WindowSet


@dataclass(frozen=True)
class TimedModel:
    """A model, ready to predict."""

    name: str  # as `find_model` knows it
    model: Model
    is_random: bool  # whether its weights are random: it takes as long as a trained one, and its answers mean nothing


def timed_model(name: str, given: Given, device: torch.device, windows: Callable[[], WindowSet]) -> TimedModel:
    """Make a model with the settings that it has by default.

    A network without weights gets random ones; what else learns is fitted to `windows`, which are asked for only then.

    Raises:
        InputError: there is no such model, it does not fit what is given, or it is told the truth.
    """
    made = find_model(name)
    settings = made.parse_settings({}, path=name)
    made.check(settings, given)
    if made.asks(settings, given) is not None:
        raise InputError("is told the truth, which no vehicle has while it drives", field=f"model {name}")
    if issubclass(made, Network):
        network = seeded_network(made, settings, given, seed=0)
        network.prepare(windows())
        return TimedModel(name, network.to(device).eval(), is_random=True)
    model = made(settings, given)
    if isinstance(model, torch.nn.Module):
        model.to(device).eval()
    if made.learns():
        model.fit(windows().to(device))
    return TimedModel(name, model, is_random=False)
