"""Contracts: what is expected of a recording, its topics, rates, gaps, latencies and values."""

import re
from pathlib import Path
from typing import Literal, NamedTuple, Self

import yaml
from pydantic import Field, field_validator, model_validator

from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.faults import not_one_of, unknown_key
from semgrid_eval.log.findings import Severity
from semgrid_eval.log.quantities import quantities_of

CAMERA, STEREO, SINGLE = "{camera}", "{stereo}", "{single}"
PLACES = (CAMERA, STEREO, SINGLE)
"""Stand in the name of a topic for every camera of a log, every one with disparity, and every one without."""
Clock = Literal["log", "publish", "stamp"]
_HEADER = """\
# What `semgrid-eval check --spec` expects of a recording. What is left out is not checked. {camera} stands for every
# camera of a log, {stereo} for every one with disparity, {single} for every one without. Times are in seconds, or in
# periods: a period is the median step from message to message of a topic.
"""


class Cameras(NamedTuple):
    """The names of a log's cameras with disparity, and of those without."""

    stereo: tuple[str, ...]
    single: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All of them, sorted."""
        return tuple(sorted((*self.stereo, *self.single)))


class Range(Config):
    """What a value may be, its ends included, and how bad it is if it is something else."""

    low: float | None = None
    high: float | None = None
    severity: Severity = Severity.WARNING

    @model_validator(mode="after")
    def _has_ends(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError("a range needs low, high or both")
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"low is {self.low:g}, above high, which is {self.high:g}")
        return self

    def holds(self, value: float) -> bool:
        """Tell whether a value is within; what is not a number is not."""
        low = float("-inf") if self.low is None else self.low
        high = float("inf") if self.high is None else self.high
        return low <= value <= high

    def __str__(self) -> str:
        if self.low is None or self.high is None:
            return f"at least {self.low:g}" if self.high is None else f"at most {self.high:g}"
        return f"{self.low:g} to {self.high:g}"


class RangeBeside(Range):
    """The same, for a value that is taken against another topic."""

    topic: str


class TopicContract(Config):
    """What is expected of the messages of one topic; each field is measured as `log/timing.py` says."""

    type: str | None = None  # of its messages
    messages: Range | None = None  # how many there are
    rate_hz: Range | None = None  # one over the period
    repeated_times: Range | None = None  # messages that have the time of the one before
    gap_s: Range | None = None  # the longest step
    gap_periods: Range | None = None
    jitter_periods: Range | None = None  # within which the middle half of all steps lies
    missing_beside: RangeBeside | None = None  # messages of another topic without one of the same time here
    uncovered_s: RangeBeside | None = None  # time of another topic before the first message here, or after the last
    values: dict[str, Range] = Field(
        default_factory=dict
    )  # of what its messages say, by the names in `log/quantities.py`


class Latency(Config):
    """How long after something a message comes, by one of its clocks.

    That is the newest message of topic `after` at or before it, by the clock `after_clock`; without `after`, the
    message itself. The clocks are the log time, the publish time and the stamp inside the message.
    """

    topic: str
    clock: Clock = "log"
    after: str | None = None
    after_clock: Clock = "stamp"
    seconds: Range


class Contract(Config):
    """What is expected of a recording; what is left out is not checked."""

    checksums: Severity | None = None  # how bad it is if there are none
    cameras: Range | None = None  # how many there are
    sensors: Range | None = None  # how many cameras and LiDARs there are; true actors count as one more
    duration_s: Range | None = None  # from the first message to the last
    largest_label_id: Range | None = None  # of all label images
    topics: dict[str, TopicContract] = Field(default_factory=dict)
    latencies: tuple[Latency, ...] = ()

    @field_validator("topics")
    @classmethod
    def _measures(cls, value: dict[str, TopicContract]) -> dict[str, TopicContract]:
        for topic, expected in value.items():
            if strange := [place for place in re.findall(r"\{.*?\}", topic) if place not in PLACES]:
                raise ValueError(f"{topic}: {not_one_of(strange[0], PLACES)}")
            allowed = quantities_of(topic)
            if unknown := [name for name in expected.values if name not in allowed]:
                raise ValueError(f"{topic}.values.{unknown[0]}: {unknown_key(unknown[0], allowed)}")
        return value


def load_contract(path: Path) -> Contract:
    """Read a contract from a YAML file.

    Raises:
        ConfigError: names the file, the field and the value at fault.
    """
    return parse_config(Contract, load_yaml(path) or {}, path=path)


def contract_text(contract: Contract) -> str:
    """Write a contract as YAML, which `load_contract` reads."""
    value = contract.model_dump(mode="json", exclude_none=True)
    for expected in value["topics"].values():
        if not expected["values"]:
            del expected["values"]
    text: str = yaml.safe_dump(value, sort_keys=False, width=120, default_flow_style=None)
    return _HEADER + text


def topics_of(name: str, cameras: Cameras) -> dict[str, str]:
    """Return the topics that a name stands for, by camera; itself by the empty name where it stands for no camera's."""
    for place, found in ((CAMERA, cameras.names), (STEREO, cameras.stereo), (SINGLE, cameras.single)):
        if place in name:
            return {camera: name.replace(place, camera) for camera in found}
    return {"": name}


def topic_beside(name: str, camera: str) -> str:
    """Return the topic that a name stands for beside a topic of a camera."""
    for place in PLACES:
        name = name.replace(place, camera)
    return name
