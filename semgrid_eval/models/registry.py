"""The table of models, the only place where their names stand; one's own are given as `path.py:Class` or installed."""

from importlib import import_module

from semgrid_eval.models.model import Model
from semgrid_eval.models.own import installed_models, own_model, own_version

_HERE = "semgrid_eval.models"
MODELS = {
    "ed": f"{_HERE}.encoder_decoder:EncoderDecoder",
    "newest": f"{_HERE}.newest:RepeatNewest",
    "overlay": f"{_HERE}.overlay:OverlaySensors",
    "fuse": f"{_HERE}.overlay:FuseAll",
    "table": f"{_HERE}.table:ClassTable",
    "flow": f"{_HERE}.flow:MoveOn",
}
"""Where the class of each built-in model lies; a new model is its module, its test and a line here."""


def find_model(name: str) -> type[Model]:
    """Find the class of a built-in, an installed or, as `path.py:Class`, one's own model.

    Code of one's own runs with the rights of this process, and is checked as `models.own` says.

    Raises:
        InputError: there is no such model, or its code cannot be loaded.
    """
    if name in MODELS:
        module, _, cls = MODELS[name].partition(":")
        found: type[Model] = getattr(import_module(module), cls)
        return found
    return own_model(name)


def version_of(name: str) -> str:
    """Return what tells a model's code from other code of the same name, and the files that it declares; part of ids.

    Raises:
        InputError: there is no such model, its code cannot be loaded, or it lacks a declared file.
    """
    return find_model(name).version if name in MODELS else own_version(name)


def is_named(name: str) -> bool:
    """Tell whether a name means a model, without loading one's own code."""
    return name in MODELS or ":" in name or name in installed_models()
