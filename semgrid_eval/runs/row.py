"""A row of a matrix: an experiment with everything that determines it; with one seed, it is a unit of a run."""

import operator
from collections.abc import Iterable, Iterator
from typing import Any, Literal, NamedTuple, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from semgrid_eval.config import Config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.faults import not_one_of
from semgrid_eval.files import digest_value
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import Truth
from semgrid_eval.models.model import AnswersIn, Given, Model
from semgrid_eval.models.registry import described, is_named, model_names
from semgrid_eval.scores.evaluate import MaskMode
from semgrid_eval.scores.facts import RowFacts, StreamFacts
from semgrid_eval.streams.config import StreamConfig
from semgrid_eval.windows.disturb.kinds import AnyDisturbance
from semgrid_eval.windows.plan import WindowConfig
from semgrid_eval.words import plural


def _found(model: str) -> type[Model] | None:
    try:
        return described(model)
    except InputError:  # told when the row's turn comes
        return None


class Row(Config):
    """One experiment with everything that determines it."""

    name: str = Field(min_length=1, max_length=200)  # unique in the matrix, like `ED-Sp2`; axes fill in `{key}` places
    model: str  # name of a built-in or installed model, or `path.py:Class` of one's own
    settings: dict[str, Any] = Field(default_factory=dict, validate_default=True)  # complete if its code can be loaded
    grid: GridConfig = GridConfig()
    # Of the inputs; those of the target if not given. A grid that is at fault itself is not among what is known.
    sensors: tuple[str, ...] = Field(
        default_factory=lambda known: known["grid"].target if "grid" in known else (), min_length=1
    )
    translate: bool = True  # whether inputs are moved to the target's time (T2); the paper's NT rows do not
    mask_mode: MaskMode = "exclude"  # what becomes of the mask M in scores (reading 9)
    repeats: int = Field(1, ge=1, le=1000)  # seeds of a model in which chance plays a part
    train_split: str = "train"
    validation_split: str = "val"
    # Groups of recordings (towns, cities, drives) of the training split that are scored instead of the validation
    # split, and not trained on: for choices, which are not to be made on what is scored in the end.
    hold_out: tuple[str, ...] = ()
    # Where the logs to score tell their exact pictures: also score against what is measured on average, see `evaluate`.
    second_target: Literal["expected"] | None = None
    window: WindowConfig = WindowConfig()
    # Leads to train on, from and to so many frames, where it is not the window's own alone: one training for all rows
    # that differ in the horizon.
    train_leads: tuple[int, int] | None = None
    # Where it differs from `window`, for recordings of another frame rate; what a file leaves out is as in `window`,
    # and the number of inputs has to be.
    validation_window: WindowConfig | None = None
    # What is wrong with the inputs that are scored; training, targets and mask M are those of the undisturbed row. It
    # is not written where it is not set, so that ids stay.
    disturb: AnyDisturbance | None = Field(None, exclude_if=operator.not_)
    # How its answers come in time, where it is scored by what is there at each time and not window by window.
    stream: StreamConfig | None = Field(None, exclude_if=operator.not_)

    @field_validator("settings")
    @classmethod
    def _complete(cls, settings: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        if not (model := _found(info.data.get("model", ""))):
            return settings
        try:
            return model.parse_settings(settings).model_dump(mode="json")
        except ConfigError as error:
            raise ConfigError(f"settings.{error}".replace("settings.(top level)", "settings")) from None

    @model_validator(mode="after")
    def _sound(self) -> Self:
        for sensor in self.sensors:
            if sensor not in self.grid.sensors:
                raise ValueError(f"sensors: {not_one_of(sensor, self.grid.sensors)}")
        if not is_named(self.model):
            raise ValueError(f"model: {not_one_of(self.model, [*model_names(), 'path.py:Class'])}")
        if self.scored_window.inputs != self.window.inputs:
            raise ValueError(
                f"validation_window.inputs: has {self.scored_window.inputs} inputs, window {self.window.inputs}"
            )
        self._check_leads()
        self._check_disturb()
        self._check_stream()
        if found := self.found_model():
            found.check(found.parse_settings(self.settings), self.given)
        return self

    def _check_leads(self) -> None:
        if self.train_leads is None:
            return
        if not 1 <= self.train_leads[0] <= self.train_leads[1]:
            raise ValueError(
                f"train_leads: {list(self.train_leads)} is not a first and a last number of frames, from 1"
            )
        reach, target = self.window.span_frames + self.train_leads[1], self.window.target_frame
        if target is not None and reach > target:
            raise ValueError(f"train_leads: reach back {plural(reach, 'frame')}, and target_frame is {target}")

    def _check_disturb(self) -> None:
        if self.disturb is None:
            return
        if self.asked is not None:
            raise ValueError("disturb: a row that is told of the truth has no inputs to disturb")
        if self.answers_in is not None:
            raise ValueError("disturb: answers that were made elsewhere have no inputs to disturb")
        self.disturb.check(self.window.inputs, self.sensors)

    def _check_stream(self) -> None:
        if self.stream is None:
            return
        if self.stream.recorded != (self.answers_in is not None):
            raise ValueError("stream.recorded: true is for model: log, which needs it")
        if self.disturb is not None or self.second_target is not None:
            raise ValueError("stream: a stream has neither disturbed inputs nor a second target")
        if self.asked is not None and self.stream.asked != "exact":
            raise ValueError("stream.asked: what is told of the truth answers for each time of evaluation: exact")
        model, asked = self.found_model(), self.stream.asked
        if asked == "capture" and model is not None and not model.baseline and not self.stream.recorded:
            raise ValueError("stream.asked: capture is for what predicts nothing; ask a network fixed or adaptive")
        if asked == "fixed" and model is not None:
            self._check_fixed_lead(*model.leads_s)
        one_lead = model is not None and model.learns() and not model.any_lead and self.train_leads is None
        if one_lead and asked != "fixed":
            raise ValueError(f"stream.asked: {asked} needs a model that answers any lead, and this one learns one")

    def _check_fixed_lead(self, shortest_s: float, longest_s: float) -> None:
        lead_ms = self.scored_window.lead_ms
        if lead_ms is not None and not shortest_s <= lead_ms / 1000 <= longest_s:
            text = f"{1000 * shortest_s:.0f} to {1000 * longest_s:.0f} ms"
            raise ValueError(f"window.lead_ms: {lead_ms:g} is not one of the leads that {self.model} answers, {text}")

    @property
    def scored_window(self) -> WindowConfig:
        """Windows that are scored."""
        return self.validation_window or self.window

    @property
    def scored_split(self) -> str:
        """The split of which recordings are scored."""
        return self.train_split if self.hold_out else self.validation_split

    @property
    def splits(self) -> set[str]:
        """The splits of which it needs grids: what learns nothing, none to train on."""
        found = self.found_model()
        return {self.scored_split} if found and not found.learns() else {self.scored_split, self.train_split}

    @property
    def leads_frames(self) -> tuple[int, ...]:
        """Leads to train on, empty where it is the window's own alone."""
        return tuple(range(self.train_leads[0], self.train_leads[1] + 1)) if self.train_leads else ()

    @property
    def given(self) -> Given:
        """What the row gives its model."""
        spec = self.grid.spec
        size = (spec.rows, spec.columns, spec.cell_m)
        return Given(self.sensors, self.window.inputs, *size, self.translate, self.grid.classes)

    def found_model(self) -> type[Model] | None:
        """Return the class of the row's model, None where its code cannot be loaded."""
        return _found(self.model)

    def identity(self) -> dict[str, object]:
        """Return what determines the row's numbers, besides code and logs: all but its name, repeats and colours.

        A second target that is not asked for changes no id.
        """
        unset = {"second_target"} if self.second_target is None else set()
        written = self.model_dump(mode="json", exclude={"name", "repeats", "grid", *unset})
        return {**written, "grid": self.grid.identity()}

    @property
    def asked(self) -> Truth | None:
        """What of the truth its model is told, if anything."""
        found = self.found_model()
        return found.asks(found.parse_settings(self.settings), self.given) if found else None

    @property
    def answers_in(self) -> AnswersIn | None:
        """Where its answers are, if they were made elsewhere."""
        found = self.found_model()
        return found.answers_in(found.parse_settings(self.settings)) if found else None

    @property
    def facts(self) -> RowFacts:
        """What the row is, whatever it is called."""
        found = self.found_model()
        return RowFacts(
            model=self.model,
            family=found.family if found else self.model.rpartition(":")[2],
            learns=found.learns() if found else False,
            baseline=found.baseline if found else False,
            inputs=self.window.inputs,
            step_frames=self.scored_window.step_frames,
            horizon_steps=self.scored_window.horizon_steps,
            lead_ms=self.scored_window.lead_ms,
            sensors=self.sensors,
            translate=self.translate,
            disturbed=self.disturb.words if self.disturb else "",
            uses_truth=self.asked is not None,
            bound=found.bound if found else "",
            stream=self._stream_facts,
        )

    @property
    def _stream_facts(self) -> StreamFacts | None:
        if self.stream is None:
            return None
        words = self.stream.model_copy(update={"added_ms": 0.0}).words
        stream = self.stream
        asked, measured = "recorded" if stream.recorded else stream.asked, stream.latency_ms is None
        return StreamFacts(
            words=words,
            added_ms=stream.added_ms,
            measured=measured,
            moved=stream.move,
            asked=asked,
            model_is_free=stream.model_is_free,
        )

    @property
    def words(self) -> str:
        """What its model does, in words."""
        found = self.found_model()
        return found.in_words(found.parse_settings(self.settings)) if found else self.model

    @property
    def label(self) -> str:
        """Name and, in words, what the row does; the horizon is always said (reading 2)."""
        horizon, lead_ms = self.scored_window.horizon_steps, self.scored_window.lead_ms
        steps = f"{plural(horizon, 'step')} of {plural(self.scored_window.step_frames, 'frame')} ahead"
        parts = [self.words, *self._inputs_in_words]
        if self.stream is None or self.stream.asked == "fixed":
            parts.append(steps if lead_ms is None else f"{lead_ms:g} ms ahead")
        parts += [each.words for each in (self.disturb, self.stream) if each]
        return f"{self.name} ({', '.join(parts)})"

    @property
    def _inputs_in_words(self) -> list[str]:
        """Say what its model is given; of answers that were made elsewhere, nothing is known."""
        if self.answers_in is not None:
            return []
        moved = "moved to the target's time" if self.translate else "not moved"
        return [moved, plural(self.window.inputs, "input")]


class Unit(NamedTuple):
    """A row with one seed; `seed` is None where chance plays no part."""

    row: Row
    seed: int | None


def plan_units(rows: Iterable[Row], first_seed: int) -> dict[str, Unit]:
    """List the distinct units of rows by key; rows that mean the same share them."""
    units: dict[str, Unit] = {}
    for row in rows:
        for key, unit in units_of(row, first_seed):
            units.setdefault(key, unit)
    return units


def units_of(row: Row, first_seed: int) -> Iterator[tuple[str, Unit]]:
    """Return the units of a row with the keys by which rows that mean the same share them."""
    model = row.found_model()
    seeds = range(first_seed, first_seed + row.repeats) if model and model.random else [None]
    for seed in seeds:
        yield digest_value([row.identity(), seed]), Unit(row, seed)
