"""Stand-ins for models of one's own: they have their facts and settings, while their code runs in a process apart."""

import importlib
import math
from dataclasses import is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from pydantic import ConfigDict
from torch import Tensor

from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.models.beside import Code
from semgrid_eval.models.fitting import Fitted, Lesson, batch_on, fit_model
from semgrid_eval.models.host import Host, code_state, current_host
from semgrid_eval.models.model import AnswersIn, Bound, Given, Model
from semgrid_eval.models.network import Network, NetworkSettings, TrainingConfig
from semgrid_eval.progress import Progress, silent
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.workplace import Limits

if TYPE_CHECKING:
    from semgrid_eval.grids.truth import Truth

_TRUTHS = "semgrid_eval.grids."  # where what may be asked of the truth is defined: it is the run that works it out
_FLOATS = {"float16": 2, "bfloat16": 2, "float32": 4, "float64": 8}  # and their bytes


class _Facts(Config):
    """What a class says of itself, and its files."""

    name: str
    network: bool
    learns: bool
    family: str
    baseline: bool
    random: bool
    any_lead: bool
    leads_s: tuple[float, float]
    bound: Bound
    files: tuple[str, ...] | None
    sources: tuple[str, ...]
    folder: str


class _Learned(Config):
    """What a guest says of a model that is ready."""

    parameters: int | None
    epochs_s: tuple[float, ...] | None


class _AnySettings(Config):
    model_config = ConfigDict(extra="allow")


class _AnyTraining(TrainingConfig):
    model_config = ConfigDict(extra="allow")


class _AnyNetworkSettings(NetworkSettings):
    model_config = ConfigDict(extra="allow")

    training: _AnyTraining = _AnyTraining()


class StandIn(Model):
    """Base of stand-ins: facts and settings are those of the class; an instance predicts where it was made ready."""

    host: ClassVar[Host]
    facts: ClassVar[_Facts]
    Settings = _AnySettings

    def predict(self, batch: WindowBatch) -> Tensor:
        """Score a batch in the process apart: (B, C, H, W) on the batch's device."""
        count, rows, columns = batch.target.shape
        shape = (count, self.given.classes.count, rows, columns)
        limit_bytes = 8 * math.prod(shape)
        found, content = self.host.ask("predict", limit_bytes=limit_bytes, batch=batch_on(batch, torch.device("cpu")))
        kind = str(found["type"]) if isinstance(found, dict) else ""
        if limit_bytes // 8 * _FLOATS.get(kind, 0) != len(content):
            raise InputError("sent what is not an answer to the run", field=self.host.name)
        scores = torch.frombuffer(bytearray(content), dtype=getattr(torch, kind))
        return scores.reshape(shape).to(batch.past.device)

    @property
    def called(self) -> str:
        """Its name in the matrix."""
        return self.host.name

    @classmethod
    def parse_settings(cls, values: object, *, path: str | None = None) -> Config:
        """Complete settings."""
        return parse_config(cls.Settings, cls.host.recall("complete", values=values, path=path), path=cls.host.name)

    @classmethod
    def in_words(cls, settings: Any) -> str:  # noqa: ANN401 - of the class `Settings`
        """Say what the model does."""
        return str(cls.host.recall("words", settings=_plain(settings)))

    @classmethod
    def check(cls, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        """Refuse what a row cannot mean."""
        cls.host.recall("check", settings=_plain(settings), given=given)

    @classmethod
    def asks(cls, settings: Any, given: Given) -> "Truth | None":  # noqa: ANN401 - of the class `Settings`
        """Say what of the truth it is told."""
        found = cls.host.recall("asks", settings=_plain(settings), given=given)
        return None if found is None else _truth(found, cls.host.name)

    @classmethod
    def answers_in(cls, settings: Any) -> AnswersIn | None:  # noqa: ANN401 - of the class `Settings`
        """Say where its answers are, if they were made elsewhere."""
        found = cls.host.recall("answers_in", settings=_plain(settings))
        return None if found is None else AnswersIn(*found)

    @classmethod
    def learns(cls) -> bool:
        """Whether it is fitted."""
        return cls.facts.learns

    @classmethod
    def code(cls) -> Code:
        """Return the files that make it."""
        return Code(tuple(Path(file) for file in cls.facts.sources), Path(cls.facts.folder))


class _StandInNetwork(StandIn, Network):
    """The stand-in of what gradients train."""

    Settings = _AnyNetworkSettings  # type: ignore[assignment] # and it has all that any settings have

    predict = StandIn.predict


def stand_in(name: str, limits: Limits) -> type[Model]:
    """Return the stand-in of a model of one's own, of the code as it is now.

    Raises:
        InputError: its code cannot be loaded.
    """
    host = current_host(name, limits)
    if host.stand_in is None:
        try:
            facts = parse_config(_Facts, host.recall("describe"), path=name)
        finally:
            host.state = code_state(host)
        host.stand_in = _class_of(host, facts)
    return host.stand_in


def _class_of(host: Host, facts: _Facts) -> type[StandIn]:
    base = _StandInNetwork if facts.network else StandIn
    told = {"family": facts.family, "baseline": facts.baseline, "random": facts.random, "bound": facts.bound}
    told |= {"any_lead": facts.any_lead, "leads_s": facts.leads_s}
    return type(facts.name, (base,), {**told, "files": facts.files, "facts": facts, "host": host})


def make_ready(made: type[Model], settings: Config, lesson: Lesson, progress: Progress = silent) -> Fitted:
    """Make a model that is ready to predict, as `fit_model` does: a stand-in's in its process apart.

    Raises:
        InputError: its code raised something, or its process has ended.
        MemoryError: it does not fit into memory.
    """
    if not issubclass(made, StandIn):
        return fit_model(made, settings, lesson, progress)
    sent = lesson.with_windows_on(torch.device("cpu"))
    threads = torch.get_num_threads()
    found, _ = made.host.ask("fit", progress=progress, settings=_plain(settings), lesson=sent, threads=threads)
    learned = parse_config(_Learned, found, path=made.host.name)
    return Fitted(made(settings, lesson.given), learned.parameters, learned.epochs_s)


def _truth(found: list[Any], name: str) -> "Truth":
    """Make what is asked of the truth from where its class is defined, its name and its fields."""
    module, kind, fields = found
    cls = getattr(importlib.import_module(module), kind) if str(module).startswith(_TRUTHS) else None
    if not (isinstance(cls, type) and is_dataclass(cls) and hasattr(cls, "find")):
        raise InputError("asks for a truth that is not known", field=name)
    make: Any = cls
    truth: Truth = make(**{key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()})
    return truth


def _plain(settings: Config) -> dict[str, Any]:
    return settings.model_dump(mode="json")
