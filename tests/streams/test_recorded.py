"""Answers as a log of predictions tells them: paired with times of evaluation as an obvious, quadratic twin does."""

import numpy as np
from hypothesis import given as generated
from hypothesis import settings
from hypothesis import strategies as st
from support.recordings import FRAME_NS, random_recording

from semgrid_eval.streams.config import StreamConfig
from semgrid_eval.streams.plan import plan_stream
from semgrid_eval.streams.schedule import NONE, Recorded
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig

FRAMES = 10
DATA = stack_recordings([random_recording(seed, frames=FRAMES, size=8) for seed in (1, 2)], cell_m=1.0)
QUARTERS = st.integers(0, 4 * FRAMES)


@st.composite
def logs(draw):
    """Captures, times that answers are for, and publications in the order of a log, in quarters of a frame."""
    made = draw(st.lists(st.tuples(QUARTERS, QUARTERS, QUARTERS), min_size=1, max_size=12))
    rows = sorted(((capture, ahead, capture + late) for capture, ahead, late in made), key=lambda row: row[2])
    capture, ahead, publish = np.array(rows, np.int64).T * (FRAME_NS // 4)
    return Recorded(capture, capture + ahead, publish)


def slowly(found, evaluated_ns):
    """Look at every answer at each time."""
    for time_ns in evaluated_ns:
        there = [k for k in range(len(found.publish_ns)) if found.publish_ns[k] <= time_ns]
        best = max(there, key=lambda k: (found.capture_ns[k], found.for_ns[k], found.publish_ns[k], k), default=NONE)
        yield best


@settings(max_examples=150, deadline=None)
@generated(st.tuples(logs(), logs()))
def test_the_newest_answer_at_each_time_is_that_of_the_slow_twin(found):
    by_name = dict(zip(DATA.recordings, found, strict=True))
    config, window = StreamConfig(recorded=True), WindowConfig(inputs=3, step_frames=4, target_frame=None)
    plan = plan_stream(
        DATA, [0, 1], config, window, lambda name, frames: None, sensors=("full",), recorded=by_name.__getitem__
    )
    stamps_ns = np.arange(FRAMES) * FRAME_NS
    expected = np.concatenate([list(slowly(each, stamps_ns)) for each in found])
    used = np.where(plan.used == NONE, NONE, plan.numbers[plan.used] if len(plan.numbers) else NONE)
    np.testing.assert_array_equal(used, expected)
    owners = np.repeat([0, 1], FRAMES)[plan.used != NONE]
    for owner, number, place in zip(owners, used[used != NONE], plan.used[plan.used != NONE], strict=True):
        own = found[owner]
        told = (own.capture_ns[number], own.for_ns[number], own.publish_ns[number])
        assert (plan.capture_ns[place], plan.for_ns[place], plan.publish_ns[place]) == told
        inputs = plan.answers.inputs[place].numpy()
        assert (DATA.locate(inputs)[0] == owner).all()
        assert DATA.stamps_ns[inputs[-1]] <= own.capture_ns[number]
