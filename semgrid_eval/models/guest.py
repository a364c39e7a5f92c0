"""Answers, in a process apart, what is asked of a model of one's own, which runs here and nowhere else."""

import logging
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import torch

from semgrid_eval.apart import Channel
from semgrid_eval.errors import ConfigError, InputError, SemgridError, first_line
from semgrid_eval.models.device import is_out_of_memory, settle_process
from semgrid_eval.models.fitting import Lesson, batch_on, fit_model
from semgrid_eval.models.model import Given, Model, require_answer
from semgrid_eval.models.network import Network
from semgrid_eval.models.registry import find_code, find_model
from semgrid_eval.windows.data import WindowBatch

Answer = tuple[Any, bytes]


def serve(descriptor: int) -> None:
    """Answer questions (name of the model, what, with what) until there are none any more."""
    settle_process()
    channel = Channel(descriptor)
    logging.getLogger("semgrid_eval").addHandler(_Teller(channel))
    guest = _Guest(channel)
    while True:
        try:
            name, what, given = channel.question()
        except EOFError:
            return
        head, content = _answered(guest, name, what, given)
        channel.say({"answer": head}, content)


class _Teller(logging.Handler):
    """Passes warnings on to the run."""

    def __init__(self, channel: Channel) -> None:
        super().__init__(logging.WARNING)
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        self._channel.say({"warning": record.getMessage()})


def _answered(guest: "_Guest", name: str, what: str, given: dict[str, Any]) -> Answer:
    """Answer, or say what went wrong; code of one's own may raise anything."""
    try:
        answer: Callable[..., Answer] = getattr(guest, what)
        found, content = answer(find_model(name), **given, **({"name": name} if what == "describe" else {}))
        return {"found": found}, content
    except InputError as error:
        kind = "config" if isinstance(error, ConfigError) else "input"
        where = {"path": None if error.path is None else str(error.path), "field": error.field}
        return {"fault": kind, "text": str(error), **where}, b""
    except BaseException as error:
        if isinstance(error, SemgridError):
            return {"fault": "input", "text": str(error), "path": None, "field": None}, b""
        if is_out_of_memory(error):
            return {"fault": "memory", "text": first_line(error)}, b""
        text = f"{type(error).__name__}: {first_line(error)}"
        return {"fault": "input", "text": text, "path": None, "field": None}, b""


class _Guest:
    """The questions; each method answers one, as JSON and bytes."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._model: Model | None = None
        self._device = torch.device("cpu")

    def describe(self, made: type[Model], name: str) -> Answer:
        """Say what a class says of itself, and which files are its code."""
        code = find_code(name)
        facts = {
            "name": made.__name__,
            "network": issubclass(made, Network),
            "learns": made.learns(),
            "family": made.family,
            "baseline": made.baseline,
            "random": made.random,
            "any_lead": made.any_lead,
            "leads_s": list(made.leads_s),
            "bound": made.bound,
            "files": made.files,
        }
        return facts | {"sources": [str(path) for path in code.sources], "folder": str(code.folder)}, b""

    def complete(self, made: type[Model], values: object, path: str | None) -> Answer:
        """Complete settings."""
        return made.parse_settings(values, path=path).model_dump(mode="json"), b""

    def words(self, made: type[Model], settings: dict[str, Any]) -> Answer:
        """Say what it does."""
        return made.in_words(made.parse_settings(settings)), b""

    def check(self, made: type[Model], settings: dict[str, Any], given: Given) -> Answer:
        """Refuse what a row cannot mean."""
        made.check(made.parse_settings(settings), given)
        return None, b""

    def asks(self, made: type[Model], settings: dict[str, Any], given: Given) -> Answer:
        """Say what it asks of the truth: where the class of that is defined, its name and its fields."""
        truth = made.asks(made.parse_settings(settings), given)
        if truth is None:
            return None, b""
        return [type(truth).__module__, type(truth).__name__, asdict(truth)], b""  # type: ignore[call-overload]

    def answers_in(self, made: type[Model], settings: dict[str, Any]) -> Answer:
        """Say where its answers are, if they were made elsewhere."""
        return made.answers_in(made.parse_settings(settings)), b""

    def fit(self, made: type[Model], settings: dict[str, Any], lesson: Lesson, threads: int) -> Answer:
        """Make it ready to predict, with seed and threads as the run has them."""
        self._model, self._device = None, lesson.device
        torch.set_num_threads(threads)
        torch.manual_seed(lesson.seed)
        lesson = lesson.with_windows_on(lesson.device)
        fitted = fit_model(made, made.parse_settings(settings), lesson, self._progress)
        self._model = fitted.model
        return {"parameters": fitted.parameters, "epochs_s": fitted.epochs_s}, b""

    def predict(self, made: type[Model], batch: WindowBatch) -> Answer:
        """Predict a batch: the type and the bytes of the scores (B, C, H, W)."""
        assert self._model is not None, "it was fitted before"
        seen = batch_on(batch, self._device)
        with torch.inference_mode():
            scores = require_answer(self._model.predict(seen), seen, self._model)
            found = scores.detach().cpu().contiguous()
            content = found.view(torch.uint8).numpy().tobytes()
        return {"type": str(found.dtype).removeprefix("torch.")}, content

    def _progress(self, done: int, total: int, message: str = "") -> None:
        self._channel.say({"progress": [done, total, message]})
