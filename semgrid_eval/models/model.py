"""What every model is to a run, built in or one's own: settings, what a row gives it, and its answer."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import torch
from torch import Tensor

from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.windows.data import WindowBatch, WindowSet
from semgrid_eval.words import plural

if TYPE_CHECKING:  # building grids needs the log readers; models do not
    from semgrid_eval.grids.truth import Truth

_SCORE_TOLERANCE = 1e-3  # of probabilities that do not quite add up to 1
Bound = Literal["", "lower", "upper"]
"""An end of the way by which reports measure rows: what anybody has, and what nobody exceeds."""


@dataclass(frozen=True)
class Given:
    """What a row gives its model, whatever the logs hold."""

    sensors: tuple[str, ...]  # names of the inputs' sensors, in the order of S
    inputs: int  # grids of each sensor, T
    rows: int  # of a grid, H
    columns: int  # W
    cell_m: float  # edge of a cell
    translate: bool  # whether inputs are moved into the target's place
    classes: ClassSet = DEFAULT_CLASSES  # of inputs and target

    @property
    def grids(self) -> int:
        """How many grids a model sees of a window, S times T."""
        return len(self.sensors) * self.inputs

    @property
    def planes(self) -> int:
        """Channels of these grids as one-hot planes, S times T times C."""
        return self.grids * self.classes.count

    def described(self) -> dict[str, object]:
        """Return what determines a model as JSON values, for digests; the default classes are left out."""
        told = {key: value for key, value in vars(self).items() if key != "classes"}
        is_default = self.classes.means(DEFAULT_CLASSES)
        return told if is_default else {**told, "classes": self.classes.identity()}


class AnswersIn(NamedTuple):
    """A folder of logs that hold the answers of a model which runs elsewhere."""

    folder: str
    topic: str | None  # that holds them; where it is not given, logs tell


class Model:
    """Base of all models: subclass it, answer in `predict`, and in `fit` learn from training windows.

    What gradients train is a `models.network.Network`. A model is made with complete settings, of its class `Settings`,
    and with what the row gives it.
    """

    Settings: ClassVar[type[Config]] = Config  # strict configuration class of what a row may set under `settings`
    words: ClassVar[str] = ""  # what it does, for labels; else the first line of the class's docstring, or its name
    family: ClassVar[str] = (
        ""  # how figures group models, like `BL`; of one's own the class's name, where it does not say
    )
    baseline: ClassVar[bool] = False  # whether other rows are measured against it
    random: ClassVar[bool] = False  # whether chance plays a part: rows are repeated with seeds of torch's generator
    bound: ClassVar[Bound] = ""  # whether it is an end of the way that rows are measured by
    files: ClassVar[tuple[str, ...] | None] = None
    """Files beside its module that it reads (weights): all of them, so that its results can be kept, or None."""
    # Leads that it can be asked for, in s, and whether what it learned answers them all: one training, any lead.
    leads_s: ClassVar[tuple[float, float]] = (0.0, 1e6)
    any_lead: ClassVar[bool] = False
    version: ClassVar[str] = "1"  # part of all ids: counted up by whoever changes the numbers of a built-in model

    def __init__(self, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        super().__init__()
        self.settings, self.given = settings, given

    @classmethod
    def parse_settings(cls, values: object, *, path: str | None = None) -> Config:
        """Complete what a row sets.

        Raises:
            ConfigError: it is not this model's.
        """
        return parse_config(cls.Settings, values, path=path)

    @classmethod
    def in_words(cls, settings: Any) -> str:  # noqa: ANN401 - of the class `Settings`
        """Say what the model does with these settings, for labels."""
        return cls.words or cls.__name__

    @classmethod
    def check(cls, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        """Refuse what a row cannot mean, before anything is read or trained.

        Raises:
            ConfigError: settings and what the row gives do not fit.
        """

    @classmethod
    def asks(cls, settings: Any, given: Given) -> "Truth | None":  # noqa: ANN401 - of the class `Settings`
        """Say what of the truth it is told in `WindowBatch.truth` when it is scored; nothing where it is a prediction.

        A row that is told is never the best one, and its scores are lines beside those of others.
        """
        return None

    @classmethod
    def answers_in(cls, settings: Any) -> AnswersIn | None:  # noqa: ANN401 - of the class `Settings`
        """Say where its answers are, if they were made elsewhere; a run then gives them in `WindowBatch.answers`."""
        return None

    def fit(self, windows: WindowSet) -> None:
        """Learn from training windows; a model that does not say how learns nothing."""

    def predict(self, batch: WindowBatch) -> Tensor:
        """Score a batch from its past and motion alone: (B, C, H, W) float.

        The class with the largest score is predicted, and that score, between 0 and 1, is its certainty: class
        probabilities where the model has them, one-hot where it has not.
        """
        raise NotImplementedError(f"{type(self).__name__} has no `predict`")

    @property
    def called(self) -> str:
        """What errors call it."""
        return type(self).__name__

    @classmethod
    def learns(cls) -> bool:
        """Whether it is fitted to training windows, by counts or by gradient."""
        return cls.fit is not Model.fit


class Baseline(Model):
    """Base of the models that others are measured against."""

    family = "BL"
    baseline = True
    files = ()


def one_hot(classes: Tensor, count: int = CLASS_COUNT) -> Tensor:
    """Turn ids of so many classes, by default the default set's, into certain scores: (B, H, W) -> (B, C, H, W).

    Ids are uint8, scores float32.
    """
    ids = torch.arange(count, dtype=torch.uint8, device=classes.device)
    return (classes[:, None] == ids[:, None, None]).float()


def require_answer(answer: object, batch: WindowBatch, model: Model) -> Tensor:
    """Return an answer to a batch, scores or logits, if it is of the type and shape (B, C, H, W) that is asked for.

    Raises:
        InputError: it is not; the message begins with the name of its model.
    """
    name, classes = model.called, model.given.classes
    if not isinstance(answer, Tensor):
        raise InputError(f"gave {type(answer).__name__} where a tensor is needed", field=name)
    count, rows, columns = batch.target.shape
    needed = (count, classes.count, rows, columns)
    if answer.ndim == 4 and answer.shape[1] < classes.count and answer.shape[0] == count:
        missing = ", ".join(classes.names[answer.shape[1] :])
        raise InputError(f"scores {plural(answer.shape[1], 'class', 'classes')}, and {missing} are missing", field=name)
    if answer.shape != needed:
        raise InputError(f"gave shape {tuple(answer.shape)} where {needed} is needed", field=name)
    if not answer.is_floating_point():
        raise InputError(f"gave {answer.dtype} where a floating-point type is needed", field=name)
    return answer


def require_scores(answer: object, batch: WindowBatch, model: Model) -> Tensor:
    """Return an answer if it is scores, all finite and the highest of each cell between 0 and 1, as `predict` says.

    Raises:
        InputError: it is not; the message begins with the name of its model.
    """
    scores = require_answer(answer, batch, model)
    # NaN and infinity come through as an extreme, in a twentieth of the time that torch.isfinite takes.
    if not all(math.isfinite(extreme) for extreme in torch.aminmax(scores)):
        raise InputError("gave scores that are NaN or infinite", field=model.called)
    low, high = (float(value) for value in torch.aminmax(scores.amax(dim=1)))
    if not -_SCORE_TOLERANCE <= low <= high <= 1 + _SCORE_TOLERANCE:
        raise InputError(f"is certain from {low:g} to {high:g}, and scores go from 0 to 1", field=model.called)
    return scores


def truth_of(batch: WindowBatch) -> Tensor:
    """Return what a model that asks is told of the truth: (B, ...).

    Raises:
        InputError: it is told nothing; only a run tells.
    """
    if batch.truth is None:
        raise InputError("this model is told of the truth, which only `semgrid-eval run` does, when it scores")
    return batch.truth


def parameter_count(model: Model) -> int | None:
    """Count the trained values of a torch module, None of anything else."""
    return sum(each.numel() for each in model.parameters()) if isinstance(model, torch.nn.Module) else None
