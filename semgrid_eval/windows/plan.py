"""Windows: which frames of a recording are inputs and which one is the target (readings 1 to 3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError


class WindowConfig(Config):
    """n inputs, `step_frames` frames apart, and a target `horizon_steps` steps after the last of them."""

    inputs: int = Field(default=2, ge=1)
    step_frames: int = Field(default=5, ge=1)
    horizon_steps: int = Field(default=1, ge=1)
    target_frame: int | None = Field(default=25, ge=0)  # the one target of a validation recording; None takes every one

    @property
    def reach_frames(self) -> int:
        """Frames from the first input to the target."""
        return (self.inputs - 1 + self.horizon_steps) * self.step_frames

    @model_validator(mode="after")
    def _inputs_lie_in_recording(self) -> Self:
        if self.target_frame is not None and self.target_frame < self.reach_frames:
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


def training_windows(frame_counts: Sequence[int], config: WindowConfig) -> WindowPlan:
    """Return every window of every recording: offsets o with inputs o, o+s, ..., o+(n-1)s and target o+(n-1+h)s.

    Raises:
        InputError: no recording is long enough.
    """
    targets = [range(config.reach_frames, count) for count in frame_counts]
    return _plan(frame_counts, targets, config, config.reach_frames + 1)


def validation_windows(frame_counts: Sequence[int], config: WindowConfig) -> WindowPlan:
    """Return one window a recording, its target at `target_frame`, which rows of other shapes share (reading 3).

    Raises:
        InputError: no recording is long enough.
    """
    if config.target_frame is None:
        return training_windows(frame_counts, config)
    needed = config.target_frame + 1
    targets = [range(config.target_frame, min(needed, count)) for count in frame_counts]
    return _plan(frame_counts, targets, config, needed)


def _plan(
    frame_counts: Sequence[int], targets: Sequence[Sequence[int]], config: WindowConfig, needed: int
) -> WindowPlan:
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
    reach, step = config.reach_frames, config.step_frames
    windows = (
        Window(recording, tuple(range(target - reach, target, step)[: config.inputs]), target)
        for recording, frames in enumerate(targets)
        for target in frames
    )
    return WindowPlan(tuple(windows), too_short)
