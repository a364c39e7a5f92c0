"""Models of one's own are guarded, so that every fault of their code is one line."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError, SemgridError
from semgrid_eval.models.beside import ModelFile
from semgrid_eval.models.device import is_out_of_memory
from semgrid_eval.models.model import AnswersIn, Given, Model, require_answer
from semgrid_eval.models.network import Network, NetworkSettings
from semgrid_eval.windows.data import WindowBatch, WindowSet

if TYPE_CHECKING:
    from semgrid_eval.grids.truth import Truth

_ATTRIBUTES = {
    "words": str,
    "family": str,
    "baseline": bool,
    "random": bool,
    "any_lead": bool,
    "files": tuple | None,
    "bound": str,
}


class _Guarded(Model):
    """Stands before a class of one's own: its exceptions and wrong answers become one line that names it."""

    _own_name: ClassVar[str]
    _own_file: ClassVar[ModelFile | None]

    def __init__(self, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        with self._guard():
            super().__init__(settings, given)

    def fit(self, windows: WindowSet) -> None:
        with self._guard():
            super().fit(windows)

    def predict(self, batch: WindowBatch) -> Tensor:
        with self._guard():
            return super().predict(batch)

    @property
    def called(self) -> str:
        return self._own_name

    @classmethod
    def parse_settings(cls, values: object, *, path: str | None = None) -> Config:
        with cls._guard():
            return super().parse_settings(values, path=path)

    @classmethod
    def in_words(cls, settings: Any) -> str:  # noqa: ANN401 - of the class `Settings`
        with cls._guard():
            return str(super().in_words(settings))

    @classmethod
    def check(cls, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        with cls._guard():
            super().check(settings, given)

    @classmethod
    def asks(cls, settings: Any, given: Given) -> "Truth | None":  # noqa: ANN401 - of the class `Settings`
        with cls._guard():
            return super().asks(settings, given)

    @classmethod
    def answers_in(cls, settings: Any) -> AnswersIn | None:  # noqa: ANN401 - of the class `Settings`
        with cls._guard():
            found = super().answers_in(settings)
        if found is not None and not isinstance(found, AnswersIn):
            raise InputError(f"gave {type(found).__name__} where `AnswersIn` is needed", field=cls._own_name)
        return found

    @classmethod
    @contextmanager
    def _guard(cls) -> Iterator[None]:
        with one_line(cls._own_name), cls._own_file.present() if cls._own_file else nullcontext():
            yield


class _GuardedNetwork(_Guarded, Network):
    """Stands before a network of one's own, also while it is trained."""

    def prepare(self, windows: WindowSet) -> None:
        with self._guard():
            super().prepare(windows)

    def forward(self, batch: WindowBatch) -> Tensor:
        # Windows in their order are views of what other rows see.
        own = replace(batch, shift_cells=batch.shift_cells.clone(), lead_s=batch.lead_s.clone())
        with self._guard():
            # What is no number ends a training by its loss, which says more.
            return require_answer(super().forward(own), batch, self)

    def loss(self, logits: Tensor, batch: WindowBatch) -> Tensor:
        with self._guard():
            loss = super().loss(logits, batch)
        if not isinstance(loss, Tensor) or loss.ndim:
            raise InputError("gave a loss that is not a tensor of one number", field=self._own_name)
        return loss

    def optimizer(self) -> torch.optim.Optimizer:
        with self._guard():
            found = super().optimizer()
        if not isinstance(found, torch.optim.Optimizer):
            raise InputError(f"gave {type(found).__name__} where an optimizer of torch is needed", field=self._own_name)
        return found


def guarded(cls: object, spec: str, file: ModelFile | None) -> type[Model]:
    """Put a guard before a class of one's own, after looking whether it is a model at all."""
    if not isinstance(cls, type) or not issubclass(cls, Model):
        raise InputError("is not a class that has `Model` or `Network` as its base", field=spec)
    base = NetworkSettings if issubclass(cls, Network) else Config
    if not issubclass(cls.Settings, base):
        raise InputError(f"has `Settings` that do not have `{base.__name__}` as their base", field=spec)
    for name, kind in _ATTRIBUTES.items():
        if not isinstance(value := getattr(cls, name), kind):
            needed = getattr(kind, "__name__", kind)
            raise InputError(f"must be of type {needed}, not {value!r}", field=f"{spec}: {name}")
    guard = _GuardedNetwork if issubclass(cls, Network) else _Guarded
    facts = {"_own_name": spec, "_own_file": file, "family": cls.family or cls.__name__, "__module__": cls.__module__}
    facts["words"] = cls.words or _first_line(cls.__doc__)
    unfitted = {} if cls.learns() else {"fit": Model.fit}  # the guard's own would look as if it learned
    return type(cls.__name__, (guard, cls), facts | unfitted)


def _first_line(docstring: str | None) -> str:
    """Return what a docstring says of its class at once, without the full stop; empty where it says nothing."""
    return next(iter((docstring or "").strip().splitlines()), "").removesuffix(".")


@contextmanager
def one_line(name: str) -> Iterator[None]:
    """Turn whatever code of one's own raises into one line, but for a lack of memory, which is not its fault."""
    try:
        yield
    except (SemgridError, KeyboardInterrupt):
        raise
    except BaseException as error:
        if is_out_of_memory(error):
            raise
        raise InputError(f"raised {type(error).__name__}: {error}", field=name) from error
