"""The streams of a run's rows: their latencies, what their models can be asked for, and the record of how they went."""

import hashlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.files import digest_files
from semgrid_eval.runs.recorded import PredictionLogs, recorded_times
from semgrid_eval.runs.row import Row
from semgrid_eval.scores.facts import StreamRecord
from semgrid_eval.scores.results import WindowRecord
from semgrid_eval.streams.plan import BLOCK_S, Latencies, StreamPlan, plan_stream
from semgrid_eval.streams.profile import LatencyProfile, read_profile
from semgrid_eval.streams.schedule import NONE, Times
from semgrid_eval.windows.grids import GridData
from semgrid_eval.windows.lead import period_ns

Floats = NDArray[np.float64]
_MS = 1_000_000


def plan_row(row: Row, data: GridData, recordings: Sequence[int], logs: PredictionLogs | None = None) -> StreamPlan:
    """Plan the stream of a row; `logs` are those with its answers, where it has some.

    Raises:
        InputError: the profile cannot be read or lacks the model, or no recording is long enough.
    """
    assert row.stream is not None
    return plan_stream(
        data,
        recordings,
        row.stream,
        row.scored_window,
        latencies_of(row),
        sensors=row.sensors,
        translate=row.translate,
        limits_ns=_limits_ns(row, data),
        recorded=None if logs is None else partial(recorded_times, logs, data, round(row.stream.added_ms * _MS)),
    )


def identity_of(row: Row) -> dict[str, object]:
    """Return what determines a stream besides its row: the content of its profile."""
    if row.stream is None or row.stream.profile is None:
        return {}
    return {"profile": digest_files([Path(row.stream.profile)])}


def latencies_of(row: Row) -> Latencies:
    """Return how long the work on each frame of a recording takes, the same whatever other recordings there are."""
    how = row.stream
    assert how is not None
    constant_ns = round((how.added_ms + (how.latency_ms or 0.0)) * _MS)
    if how.profile is None:
        return lambda name, frames: np.full(frames, constant_ns, np.int64)
    profile = read_profile(Path(how.profile))
    model = None if how.model_is_free else how.profile_model or row.model
    try:
        profile.chain_ms(model)
    except InputError as error:  # it lacks the model
        raise InputError(str(error), path=Path(how.profile)) from None
    return partial(_drawn, profile, model, seed=how.seed, scale=how.scale, added_ns=constant_ns)


def _drawn(
    profile: LatencyProfile, model: str | None, name: str, frames: int, *, seed: int, scale: float, added_ns: int
) -> Times:
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:6], "big")
    return profile.draw_ns(model, frames, seed=key, scale=scale) + added_ns


def _limits_ns(row: Row, data: GridData) -> tuple[int, int]:
    """Return the shortest and the longest lead that a row's model can be asked for."""
    if row.train_leads is not None:
        period = period_ns(data.stamps_ns[: data.first_frames[1]])
        return row.train_leads[0] * period, row.train_leads[1] * period
    model = row.found_model()
    shortest_s, longest_s = model.leads_s if model else (0.0, 1e6)
    return int(shortest_s * 1e9), int(longest_s * 1e9)


def stream_record(plan: StreamPlan) -> StreamRecord:
    """Say how a stream went: how old its answers were where they were used, and where there was none."""
    data, there = plan.answers.data, plan.used != NONE
    used = plan.used[there]
    age_ms = (data.stamps_ns[plan.evaluated[there]] - plan.capture_ns[used]) / _MS
    return StreamRecord(
        evaluations=len(plan.used),
        misses=int((~there).sum()),
        answers=len(plan.took_ns),
        first_answer_ms=round(float(plan.first_answer_ns.max()) / _MS, 3),
        age_ms=_median(age_ms),
        oldest_ms=_percentile(age_ms, 99),
        latency_ms=_median(plan.took_ns / _MS),
        lead_ms=_median((plan.for_ns[used] - plan.capture_ns[used]) / _MS),
    )


def block_records(plan: StreamPlan, log_of: dict[str, str]) -> tuple[WindowRecord, ...]:
    """Describe the blocks of a stream as windows: from the beginning of each to its end."""
    data, length_ns = plan.answers.data, int(BLOCK_S * 1e9)
    _, begins = np.unique(plan.blocks(), return_index=True)
    frames = plan.evaluated[begins]
    found = []
    for frame, owner, place in zip(frames, *data.locate(frames), strict=True):
        first_ns = int(data.stamps_ns[data.first_frames[owner]])
        begin_ns = first_ns + (int(data.stamps_ns[frame]) - first_ns) // length_ns * length_ns
        name = data.recordings[owner]
        found.append(
            WindowRecord(
                recording=name,
                log=log_of[name],
                target_frame=int(place),
                target_stamp_ns=begin_ns + length_ns,
                input_stamps_ns=(begin_ns,),
            )
        )
    return tuple(found)


def _median(values: Floats) -> float:
    return _percentile(values, 50)


def _percentile(values: Floats, share: float) -> float:
    return round(float(np.percentile(values, share)), 3) if len(values) else 0.0
