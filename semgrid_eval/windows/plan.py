"""Which frames are the inputs and the target of each window (readings 1 to 3)."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.windows.lead import LONGEST_LEAD_MS, lead_from


class TooEarlyError(InputError):
    """The one target of a validation recording lies before what inputs and lead need."""


class WindowConfig(Config):
    """n inputs, `step_frames` frames apart, and a target `horizon_steps` steps after the last of them."""

    inputs: int = Field(default=2, ge=1)
    step_frames: int = Field(default=5, ge=1)
    horizon_steps: int = Field(default=1, ge=1)
    # Time to the target, to the nearest frame, instead of whole steps; `from FILE` takes the best one of a report.
    lead_ms: Annotated[float, BeforeValidator(lead_from)] | None = Field(
        None, gt=0, le=LONGEST_LEAD_MS, exclude_if=operator.not_
    )
    target_frame: int | None = Field(default=25, ge=0)  # the one target of a validation recording; None takes every one

    @property
    def span_frames(self) -> int:
        """Frames from the first input to the newest."""
        return (self.inputs - 1) * self.step_frames

    @property
    def lead_frames(self) -> int:
        """Frames from the newest input to the target, where these are whole steps."""
        return self.horizon_steps * self.step_frames

    @property
    def reach_frames(self) -> int:
        """Frames from the first input to the target."""
        return self.span_frames + self.lead_frames

    def input_frames(self, target: int, lead_frames: int) -> tuple[int, ...]:
        """Return the frames of the inputs, oldest first, the newest so many frames before the target."""
        newest = target - lead_frames
        return tuple(range(newest - self.span_frames, newest + 1, self.step_frames))

    @model_validator(mode="after")
    def _inputs_lie_in_recording(self) -> Self:
        if self.lead_ms is not None and self.horizon_steps != 1:
            raise ValueError("give one of lead_ms and horizon_steps")
        if self.lead_ms is None and self.target_frame is not None and self.target_frame < self.reach_frames:
            shape = f"inputs {self.inputs}, step_frames {self.step_frames} and horizon_steps {self.horizon_steps}"
            raise ValueError(
                f"target_frame {self.target_frame} is too early: {shape} reach back {self.reach_frames} frames"
            )
        return self


@dataclass(frozen=True)
class Window:
    """One sample: the index of its recording and the frames there, inputs from the oldest to the newest."""

    recording: int
    input_frames: tuple[int, ...]
    target_frame: int


@dataclass(frozen=True)
class WindowPlan:
    """The windows of some recordings, and the reason for each recording (by its index) that is too short for one."""

    windows: tuple[Window, ...]
    too_short: dict[int, str]


def training_windows(frame_counts: Sequence[int], config: WindowConfig, leads_frames: Sequence[int] = ()) -> WindowPlan:
    """Return every window of every recording: offsets o with inputs o, o+s, ..., o+(n-1)s and target o+(n-1+h)s.

    With `leads_frames`, frames from the newest input to the target, there are those of each of these leads instead.

    Raises:
        InputError: no recording is long enough.
    """
    leads = leads_frames or [config.lead_frames]
    return _every_target(frame_counts, config, [leads] * len(frame_counts), min(leads))


def validation_windows(
    frame_counts: Sequence[int], config: WindowConfig, leads_frames: Sequence[int] = ()
) -> WindowPlan:
    """Return one window a recording, its target at `target_frame`, which rows of other shapes share (reading 3).

    Without `target_frame`, there is one for each target that a recording has. With `leads_frames`, recordings take one
    of these leads after the other, of those that they are long enough for.

    Raises:
        TooEarlyError: `target_frame` is not as far from a recording's beginning as inputs and lead reach.
        InputError: no recording is long enough.
    """
    leads, target = leads_frames or [config.lead_frames], config.target_frame
    if target is None:
        fitting = ([lead for lead in leads if config.span_frames + lead < count] for count in frame_counts)
        turns = [few[index % len(few) :][:1] if few else [] for index, few in enumerate(fitting)]
        return _every_target(frame_counts, config, turns, min(leads))
    if target < config.span_frames + max(leads):
        reach = config.span_frames + max(leads)
        fault = (
            f"{target} is too early: inputs and lead reach back {reach} frames; null takes every target that there is"
        )
        raise TooEarlyError(fault, field="window.target_frame")
    found = [
        Window(recording, config.input_frames(target, leads[recording % len(leads)]), target)
        for recording, count in enumerate(frame_counts)
        if target < count
    ]
    return _plan(frame_counts, found, target + 1)


def _every_target(
    frame_counts: Sequence[int], config: WindowConfig, leads: Sequence[Sequence[int]], shortest: int
) -> WindowPlan:
    """Plan the windows of every target for the leads of each recording; `shortest` is the least lead of all."""
    found = [
        Window(recording, config.input_frames(target, lead), target)
        for recording, (count, each) in enumerate(zip(frame_counts, leads, strict=True))
        for lead in each
        for target in range(config.span_frames + lead, count)
    ]
    return _plan(frame_counts, found, config.span_frames + shortest + 1)


def _plan(frame_counts: Sequence[int], windows: Sequence[Window], needed: int) -> WindowPlan:
    too_short = {
        recording: f"has {count} frames, and a window needs {needed}"
        for recording, count in enumerate(frame_counts)
        if count < needed
    }
    if len(too_short) == len(frame_counts):
        longest = max(frame_counts, default=0)
        raise InputError(
            f"a window needs {needed} frames, and the longest of {len(too_short)} recordings has {longest}"
        )
    return WindowPlan(tuple(windows), too_short)
