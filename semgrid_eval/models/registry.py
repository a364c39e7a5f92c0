"""The table of models, the only place where their names stand; one's own are given as `path.py:Class` or installed."""

import importlib.metadata
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.faults import not_one_of
from semgrid_eval.models.beside import Code, ModelFile, require_python, undefined
from semgrid_eval.models.host import end_guests, known_answers, learn_answers
from semgrid_eval.models.model import Model
from semgrid_eval.models.own import guarded, one_line
from semgrid_eval.models.stand_in import StandIn, stand_in
from semgrid_eval.workplace import Limits

ENTRY_POINT_GROUP = "semgrid_eval.models"
_HERE = "semgrid_eval.models"
MODELS = {
    "ed": f"{_HERE}.encoder_decoder:EncoderDecoder",
    "residual": f"{_HERE}.residual:Residual",
    "residual-flow": f"{_HERE}.residual_flow:ResidualFlow",
    "residual-town": f"{_HERE}.shipped:TownResidual",
    "newest": f"{_HERE}.newest:RepeatNewest",
    "overlay": f"{_HERE}.overlay:OverlaySensors",
    "fuse": f"{_HERE}.overlay:FuseAll",
    "table": f"{_HERE}.table:ClassTable",
    "flow": f"{_HERE}.flow:MoveOn",
    "true_motion": f"{_HERE}.true_motion:FuseTrueMotion",
    "fresh": f"{_HERE}.fresh:FreshErrors",
    "ceiling": f"{_HERE}.ceiling:Ceiling",
    "log": f"{_HERE}.recorded:Recorded",
}
"""Where the class of each built-in model lies; a new model is its module, its test and a line here."""
_loaded: dict[str, tuple[ModelFile, type[Model]]] = {}
_limits: ContextVar[Limits | None] = ContextVar("limits of models of one's own; None where they run in this process")
_USUAL = Limits()


def find_model(name: str) -> type[Model]:
    """Find the class of a built-in, an installed or, as `path.py:Class`, one's own model.

    Code of one's own runs with the rights of this process, and is checked as `models.own` says. A file is run once, and
    again when it has changed.

    Raises:
        InputError: there is no such model, or its code cannot be loaded.
    """
    if name in MODELS:
        module, _, cls = MODELS[name].partition(":")
        found: type[Model] = getattr(importlib.import_module(module), cls)
        return found
    if ":" in name:
        return _from_file(name)[1]
    with one_line(name):
        cls = _entry_point(name).load()
    return guarded(cls, name, None)


def described(name: str) -> type[Model]:
    """Find a model as `find_model` does; of one's own, a stand-in for its class in a process apart.

    Raises:
        InputError: there is no such model, its code cannot be loaded, or ends its process or runs out of its time.
    """
    limits = _limits.get(_USUAL)
    if name in MODELS or limits is None:
        return find_model(name)
    if ":" in name:
        require_python(Path(name.rpartition(":")[0]))
    else:
        _entry_point(name)
    return stand_in(name, limits)


@contextmanager
def own_models(limits: Limits | None) -> Iterator[None]:
    """Run models of one's own within these limits in processes apart, or in this one, while the block lasts."""
    before = _limits.set(limits)
    try:
        yield
    finally:
        _limits.reset(before)
        end_guests()


def ways_of_own_models() -> tuple[Limits | None, str]:
    """Return what another process must know to treat models of one's own as this one does: see `adopt`."""
    return _limits.get(_USUAL), known_answers()


def adopt(limits: Limits | None, known: str) -> None:
    """Treat models of one's own from now on as another process does, and know what it has asked them."""
    _limits.set(limits)
    if limits is not None:
        learn_answers(known, limits)


def version_of(name: str) -> str:
    """Return what tells a model's code from other code of the same name, and the files that it declares; part of ids.

    Of a file it is a digest with what it imports from beside it; of an installed model the version of its package and
    the module of its class.

    Raises:
        InputError: there is no such model, its code cannot be loaded, or it lacks a declared file.
    """
    made = described(name)
    if name in MODELS:
        return made.version
    code = made.code() if issubclass(made, StandIn) else find_code(name)
    return code.version(made.files or (), name, None if ":" in name else installed_models()[name])


def find_code(name: str) -> Code:
    """Find the files of a model of one's own, whose code runs in this process."""
    if ":" in name:
        file = _from_file(name)[0]
        return Code(tuple(file.sources()), file.folder)
    find_model(name)
    module = Path(str(sys.modules[_entry_point(name).module].__file__))
    return Code((module,), module.parent)


def is_named(name: str) -> bool:
    """Tell whether a name means a model, without loading one's own code."""
    return name in MODELS or ":" in name or name in installed_models()


def model_names() -> list[str]:
    """List the names of all built-in and installed models."""
    return list(dict.fromkeys([*MODELS, *installed_models()]))


def installed_models() -> dict[str, str]:
    """List the models that packages have registered: name -> package and version."""
    found = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
    return {entry.name: f"{entry.dist.name} {entry.dist.version}" if entry.dist else "" for entry in found}


def _from_file(spec: str) -> tuple[ModelFile, type[Model]]:
    if spec not in _loaded or not _loaded[spec][0].is_current():
        path, _, name = spec.rpartition(":")
        file = ModelFile(Path(path))
        with one_line(path):
            module = file.load()
        if not hasattr(module, name):
            raise undefined(path, name)
        _loaded[spec] = file, guarded(getattr(module, name), spec, file)
    return _loaded[spec]


def _entry_point(name: str) -> importlib.metadata.EntryPoint:
    known = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
    if name not in known.names:
        raise InputError(not_one_of(name, [*model_names(), "path.py:Class"]), field="model")
    return known[name]
