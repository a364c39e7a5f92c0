"""Which frames are the inputs and the target of each window (readings 1 to 3)."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.windows.lead import LONGEST_LEAD_MS, lead_from
from semgrid_eval.words import plural

Indices = NDArray[np.int32]


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

    def frames(self, target: int, lead_frames: int) -> list[int]:
        """Return the frames of the inputs, oldest first, the newest so many frames before the target, and its own."""
        newest = target - lead_frames
        return [*range(newest - self.span_frames, newest + 1, self.step_frames), target]

    @model_validator(mode="after")
    def _inputs_lie_in_recording(self) -> Self:
        if self.lead_ms is not None and self.horizon_steps != 1:
            raise ValueError("give one of lead_ms and horizon_steps")
        if self.lead_ms is None and self.target_frame is not None and self.target_frame < self.reach_frames:
            shape = f"inputs {self.inputs}, step_frames {self.step_frames} and horizon_steps {self.horizon_steps}"
            reach = plural(self.reach_frames, "frame")
            raise ValueError(f"target_frame {self.target_frame} is too early: {shape} reach back {reach}")
        return self


@dataclass(frozen=True, eq=False)
class Windows:
    """N samples: the index of each one's recording and the frames there, inputs from the oldest to the newest."""

    recording: Indices  # (N,)
    frames: Indices  # (N, T + 1) of the inputs, then of the target

    def __len__(self) -> int:
        return len(self.recording)

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Windows":
        return Windows(self.recording[chosen], self.frames[chosen])


@dataclass(frozen=True)
class WindowPlan:
    """The windows of some recordings, and the reason for each recording (by its index) that is too short for one."""

    windows: Windows
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
        reach = plural(config.span_frames + max(leads), "frame")
        fault = f"{target} is too early: inputs and lead reach back {reach}; null takes every target that there is"
        raise TooEarlyError(fault, field="window.target_frame")
    recordings = np.flatnonzero(np.array(frame_counts) > target)
    frames = np.array([config.frames(target, lead) for lead in leads], np.int32)
    return _plan(frame_counts, Windows(recordings.astype(np.int32), frames[recordings % len(leads)]), target + 1)


def _every_target(
    frame_counts: Sequence[int], config: WindowConfig, leads: Sequence[Sequence[int]], shortest: int
) -> WindowPlan:
    """Plan the windows of every target for the leads of each recording; `shortest` is the least lead of all."""
    # Recordings are alike: what has as many frames, and the same leads, shares its table.
    tables: dict[tuple[int, ...], Indices] = {}
    for count, each in zip(frame_counts, leads, strict=True):
        if (count, *each) not in tables:
            tables[count, *each] = _frames(count, config, each)
    found = [tables[count, *each] for count, each in zip(frame_counts, leads, strict=True)]
    recording = np.repeat(np.arange(len(found), dtype=np.int32), np.array([len(table) for table in found], int))
    windows = Windows(recording, np.concatenate([_frames(0, config, ()), *found]))
    return _plan(frame_counts, windows, config.span_frames + shortest + 1)


def _frames(count: int, config: WindowConfig, leads: Sequence[int]) -> Indices:
    """List the frames of the windows of a recording with so many: -> (N, T + 1)."""
    targets = [(target, lead) for lead in leads for target in range(config.span_frames + lead, count)]
    found = [config.frames(target, lead) for target, lead in targets]
    return np.array(found, np.int32).reshape(-1, config.inputs + 1)


def _plan(frame_counts: Sequence[int], windows: Windows, needed: int) -> WindowPlan:
    too_short = {
        recording: f"has {plural(count, 'frame')}, and a window needs {needed}"
        for recording, count in enumerate(frame_counts)
        if count < needed
    }
    if len(too_short) == len(frame_counts):
        longest = f"the longest recording (of {len(too_short)}) has {max(frame_counts, default=0)}"
        raise InputError(f"a window needs {plural(needed, 'frame')}, and {longest}")
    return WindowPlan(windows, too_short)
