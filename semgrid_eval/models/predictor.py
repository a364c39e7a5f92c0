"""Predictors: what every model looks like to the scores, and how one's own is found and checked."""

import importlib.metadata
import importlib.util
import sys
from pathlib import Path
from typing import Any, Protocol

import torch
from torch import Tensor

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES
from semgrid_eval.errors import InputError
from semgrid_eval.windows.data import WindowBatch

_beside: Path | None = None  # folder of the model's file that was loaded last
ENTRY_POINT_GROUP = "semgrid_eval.models"


class Predictor(Protocol):
    """Anything that scores the classes of each cell of the target."""

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Score a batch from its past and motion alone: (B, C, H, W) float.

        The class with the largest score is predicted, and that score, between 0 and 1, is its certainty: class
        probabilities where the model has them, one-hot where it has not.
        """


class CheckedPredictor:
    """A predictor of somebody else's, every answer of which is checked."""

    def __init__(self, predictor: Predictor, name: str) -> None:
        self._predictor = predictor
        self._name = name

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Ask the predictor and check what it says.

        Raises:
            InputError: it raised, or its answer has the wrong shape, too few classes, another type or NaN.
        """
        try:
            scores = self._predictor(batch)
        except (Exception, SystemExit) as error:
            raise InputError(f"raised {type(error).__name__}: {error}", field=self._name) from error
        fault = _fault(scores, batch)
        if fault:
            raise InputError(fault, field=self._name)
        return scores


def load_predictor(spec: str, device: torch.device | None = None) -> Predictor:
    """Make the predictor that `path.py:Class` or the name of an entry point in `semgrid_eval.models` stands for.

    The class is called without arguments; a torch module is moved to the device, if one is given. The code runs with
    the rights of this process.

    Raises:
        InputError: there is no such file, class or entry point, or making it failed.
    """
    path, separator, name = spec.rpartition(":")
    factory = _from_file(Path(path), name) if separator else _from_entry_point(spec)
    try:
        predictor = factory()
    except (Exception, SystemExit) as error:
        raise InputError(f"raised {type(error).__name__}: {error}", field=spec) from error
    if not callable(predictor):
        raise InputError("gives an object that cannot be called", field=spec)
    if isinstance(predictor, torch.nn.Module):
        predictor.eval().to(device)
    return CheckedPredictor(predictor, spec)


def installed_models() -> dict[str, str]:
    """List the models that packages have registered: name -> package and version."""
    found = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
    return {entry.name: f"{entry.dist.name} {entry.dist.version}" if entry.dist else "" for entry in found}


def one_hot(classes: Tensor) -> Tensor:
    """Turn class ids into certain scores: (B, H, W) uint8 -> (B, C, H, W) float32."""
    ids = torch.arange(CLASS_COUNT, dtype=torch.uint8, device=classes.device)
    return (classes[:, None] == ids[:, None, None]).float()


def _from_file(path: Path, name: str) -> Any:  # noqa: ANN401 - whatever the file defines
    spec = importlib.util.spec_from_file_location(f"semgrid_eval_model_{path.stem}", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise InputError("is not a Python file; a model is given as path.py:Class", path=path)
    _look_beside(path.resolve().parent)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look a class's module up by name
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise InputError(f"raised {type(error).__name__}: {error}", path=path) from error
    if not hasattr(module, name):
        raise InputError(f"defines no {name!r}", path=path)
    return getattr(module, name)


def _look_beside(folder: Path) -> None:
    """Let a model import what lies beside it, as if its file were run, and not what lies beside the model before."""
    global _beside
    if _beside is not None and _beside != folder:
        sys.path.remove(str(_beside))
        for name, module in list(sys.modules.items()):
            if (file := getattr(module, "__file__", None)) and _beside in Path(file).parents:
                del sys.modules[name]
    if _beside != folder:
        sys.path.insert(0, str(folder))
        _beside = folder


def _from_entry_point(name: str) -> Any:  # noqa: ANN401 - whatever the package registered
    known = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
    if name not in known.names:
        names = ", ".join(sorted(known.names)) or "none"
        raise InputError(f"no model {name!r} is installed ({names} found); a file is given as path.py:Class")
    try:
        return known[name].load()
    except (Exception, SystemExit) as error:
        raise InputError(f"raised {type(error).__name__}: {error}", field=name) from error


def _fault(scores: object, batch: WindowBatch) -> str | None:
    """Say in one line what is wrong with an answer, None where nothing is."""
    if not isinstance(scores, Tensor):
        return f"gave a {type(scores).__name__} where a tensor is needed"
    count, rows, columns = batch.target.shape
    if scores.ndim == 4 and scores.shape[1] < CLASS_COUNT and scores.shape[0] == count:
        return f"scores {scores.shape[1]} classes, and {', '.join(CLASS_NAMES[scores.shape[1] :])} are missing"
    if scores.shape != (count, CLASS_COUNT, rows, columns):
        return f"gave shape {tuple(scores.shape)} where {(count, CLASS_COUNT, rows, columns)} is needed"
    if not scores.is_floating_point():
        return f"gave {scores.dtype} where a floating-point type is needed"
    return None if bool(torch.isfinite(scores).all()) else "gave scores that are NaN or infinite"
