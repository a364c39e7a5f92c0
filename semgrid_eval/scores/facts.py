"""What a row is and how its answers came, whatever it is called: kept with its results."""

from typing import Literal

from semgrid_eval.config import Config


class StreamFacts(Config):
    """How a row's answers come in time."""

    words: str  # in words, without what is added to the latency
    added_ms: float  # on top of the latency of its chain
    measured: bool  # whether its latency was measured, by a profile or by who made the answers
    moved: bool  # whether answers are moved along with the vehicle
    asked: str  # the time that a grid is for, as `streams.config` names it
    model_is_free: bool  # whether the model's own time is left out


class StreamRecord(Config):
    """How a stream went; medians are over answers, those of age and lead over the times of evaluation."""

    evaluations: int  # times of evaluation
    misses: int  # of these, without any answer yet
    answers: int  # that were made, used or not
    first_answer_ms: float  # from a recording's first frame to its first answer, of the slowest recording
    age_ms: float  # from the capture of the newest input to the time of evaluation, median
    oldest_ms: float  # the same, 99th percentile
    latency_ms: float  # from the beginning of the work to publication
    lead_ms: float  # from the capture of the newest input to the time that the grid is for


class RowFacts(Config):
    """What a row is, whatever it is called: differences, pairs, curves and examples are formed by this alone."""

    model: str  # as the matrix names it: `ed`, `fuse`, `mine.py:Mine`
    family: str  # of models, which figures draw alike: `ED`, `BL`, or that of a model of one's own
    learns: bool  # whether it was fitted to training windows, by counts or by gradient
    baseline: bool  # whether other rows are measured against it
    inputs: int  # grids of the past, by sensor
    step_frames: int  # frames between inputs
    horizon_steps: int  # steps from the newest input to the target
    lead_ms: float | None = None  # instead of these, where it is set in ms
    sensors: tuple[str, ...]  # names of the inputs' sensors
    translate: bool  # whether inputs are moved into the target's place
    disturbed: str = ""  # what is wrong with its inputs, in words; empty where nothing is
    uses_truth: bool = (
        False  # whether it is told of the truth, so that it is a line beside the others and never the best
    )
    # Whether it is an end of the way that others are measured by: what anybody has, or what nobody exceeds.
    bound: Literal["", "lower", "upper"] = ""
    stream: StreamFacts | None = None  # of a row that is scored as its answers come
