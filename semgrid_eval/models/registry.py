"""The table of models, the only place where their names stand; one's own are given as `path.py:Class` or installed."""

import importlib.metadata
import sys
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.models.beside import ModelFile
from semgrid_eval.models.model import Model
from semgrid_eval.models.own import guarded, one_line

ENTRY_POINT_GROUP = "semgrid_eval.models"
_HERE = "semgrid_eval.models"
MODELS = {
    "ed": f"{_HERE}.encoder_decoder:EncoderDecoder",
    "residual": f"{_HERE}.residual:Residual",
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


def version_of(name: str) -> str:
    """Return what tells a model's code from other code of the same name, and the files that it declares; part of ids.

    Of a file it is a digest with what it imports from beside it; of an installed model the version of its package and
    the module of its class.

    Raises:
        InputError: there is no such model, its code cannot be loaded, or it lacks a declared file.
    """
    if name in MODELS:
        return find_model(name).version
    if ":" in name:
        file, cls = _from_file(name)
        return digest_files([*file.sources(), *_declared(cls, file.folder, name)])
    cls, module = find_model(name), Path(str(sys.modules[_entry_point(name).module].__file__))
    return digest_value([installed_models()[name], digest_files([module, *_declared(cls, module.parent, name)])])


def is_named(name: str) -> bool:
    """Tell whether a name means a model, without loading one's own code."""
    return name in MODELS or ":" in name or name in installed_models()


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
            raise InputError(f"defines no {name!r}", path=path)
        _loaded[spec] = file, guarded(getattr(module, name), spec, file)
    return _loaded[spec]


def _entry_point(name: str) -> importlib.metadata.EntryPoint:
    known = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
    if name not in known.names:
        names = ", ".join(sorted(known.names)) or "none"
        raise InputError(f"no model {name!r} is installed ({names} found); a file is given as path.py:Class")
    return known[name]


def _declared(cls: type[Model], folder: Path, spec: str) -> list[Path]:
    for name in cls.files or ():
        if not (folder / name).is_file():
            raise InputError(f"declares the file {name}, which is not in {folder}", field=f"{spec}: files")
    return [folder / name for name in cls.files or ()]
