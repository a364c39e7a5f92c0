"""How a row's answers come in time: settings of its `stream`."""

from typing import Literal, Self

from pydantic import Field, model_validator

from semgrid_eval.config import Config

Worker = Literal["one", "many"]
Rule = Literal["newest", "shrinking_tail"]
Asked = Literal["capture", "fixed", "adaptive", "known", "exact"]

ASKED_IN_WORDS: dict[Asked, str] = {
    "capture": "as captured",
    "fixed": "predicted for a fixed lead",
    "adaptive": "predicted for when it will be used, as past answers tell",
    "known": "predicted for when it will be used, known beforehand",
    "exact": "predicted anew for each time of evaluation",
}


class StreamConfig(Config):
    """A row scored as it runs: at each time of evaluation by the newest grid that is published by then.

    Latency is `latency_ms`, or drawn from the whole chain of a measured `profile` times `scale`; `added_ms` comes on
    top. It is the time from the capture of the newest input to the publication of the grid, once a worker has begun.
    Of answers that lie in logs it is as `recorded`.
    """

    recorded: bool = False  # answers, what they are for and their publication are those of a log of predictions
    latency_ms: float | None = Field(None, ge=0, le=60_000)
    profile: str | None = Field(None, min_length=1)  # file that `semgrid-eval latency` writes
    profile_model: str | None = None  # whose latency the profile is asked for; the row's own if not given
    model_is_free: bool = False  # a bound: the rest of the profile's chain alone takes time
    scale: float = Field(1.0, gt=0, le=1000)  # of the profile: another machine
    added_ms: float = Field(0.0, ge=0, le=60_000)
    workers: Worker = "one"  # one is busy while it works; `many` begin with every frame
    rule: Rule = "newest"  # when one worker begins: at once with the newest frame, or by sAP's shrinking tail
    asked: Asked = "capture"  # the time that a grid is for
    move: bool = True  # whether grids are brought to the vehicle's position at the time of evaluation
    rate_hz: float | None = Field(None, gt=0, le=1000)  # of evaluation; at the capture of every frame if not given
    seed: int = Field(0, ge=0)  # of what is drawn

    @model_validator(mode="after")
    def _one_source_of_latency(self) -> Self:
        sources = {"latency_ms": self.latency_ms is not None, "profile": self.profile is not None}
        given = [name for name, is_given in {**sources, "recorded": self.recorded}.items() if is_given]
        if len(given) != 1:
            raise ValueError(f"give one of latency_ms, profile and recorded: true, not {' and '.join(given) or 'none'}")
        if self.recorded and (self.workers, self.rule, self.asked) != ("one", "newest", "capture"):
            raise ValueError("recorded: workers, rule and asked are of what is simulated, and nothing is")
        if self.profile is None and (self.scale != 1.0 or self.profile_model is not None):
            raise ValueError("scale and profile_model belong to a profile, and none is given")
        if self.model_is_free and (self.profile is None or self.profile_model is not None):
            raise ValueError("model_is_free: give a profile, and no profile_model")
        if self.workers == "many" and self.rule != "newest":
            raise ValueError("rule: one worker waits, many do not")
        return self

    @property
    def words(self) -> str:
        """Say how its answers come."""
        added = f" and {self.added_ms:g} ms" if self.added_ms else ""
        moved = "moved along with the vehicle" if self.move else "not moved"
        if self.recorded:
            return f"published as recorded{added}, {moved}"
        latency = f"{self.latency_ms:g} ms" if self.profile is None else f"latency of {self.profile}"
        latency += " without the model's own" * self.model_is_free
        if self.scale != 1.0:
            latency = f"{self.scale:g} times the {latency}"
        worker = {"one": "one worker", "many": "as many workers as needed"}[self.workers]
        rule = " that waits for a shrinking tail" * (self.rule == "shrinking_tail")
        return f"{ASKED_IN_WORDS[self.asked]}, {moved}, {latency}{added}, {worker}{rule}"
