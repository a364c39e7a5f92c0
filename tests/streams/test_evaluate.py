"""Streams against plain rows to the count, and against an answer that is worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from support.models import given, made
from support.recordings import FRAME_NS, random_recording, recording

from semgrid_eval.classes import CLASS_COUNT, UNKNOWN
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.overlay import FuseAll
from semgrid_eval.scores.evaluate import evaluate
from semgrid_eval.scores.metrics.iou import confusion
from semgrid_eval.streams.config import StreamConfig
from semgrid_eval.streams.evaluate import evaluate_stream, unseen_truth
from semgrid_eval.streams.plan import evaluated_frames, plan_stream, positions_at
from semgrid_eval.streams.schedule import Recorded
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

SIZE, FRAMES = 16, 24
SPEC = GridSpec(rows=SIZE, columns=SIZE, cell_m=1.0, agent_row=SIZE, agent_column=SIZE // 2)


def constant(frames_late):
    return lambda name, count: np.full(count, frames_late * FRAME_NS, np.int64)


@pytest.fixture(name="data", scope="module")
def data_fixture():
    return stack_recordings([random_recording(seed, frames=FRAMES, size=SIZE) for seed in (1, 2)], cell_m=1.0)


def plan_of(data, *, late, window=None, latencies=None, limits_ns=(0, 1 << 62), translate=True, **how):
    config = StreamConfig(**{"latency_ms": 0.0, "workers": "many", **how})
    window = window or WindowConfig(inputs=2, step_frames=2, target_frame=None)
    recordings = range(len(data.recordings))
    latencies = latencies or constant(late)
    return plan_stream(
        data, recordings, config, window, latencies, sensors=("full",), translate=translate, limits_ns=limits_ns
    )


def streamed(model, plan, *, move):
    counted = evaluate_stream(model, plan, spec=SPEC, move=move, batch=5)
    return counted.sums["iou", "all"][:, 0].sum(axis=0)


def plain(data, model, window, *, translate):
    """Score all windows with the stream's M, and count a miss at every frame that has no window."""
    windows = select_windows(data, training_windows(data.frame_counts, window).windows, sensors=("full",))
    windows = replace(windows, translate=translate)
    prediction, targets = evaluate(model, windows, spec=SPEC).prediction, windows.target_frames.numpy()
    found = np.zeros((CLASS_COUNT, CLASS_COUNT), np.int64)
    for frame in range(data.grids.shape[1]):
        truth, left_out = data.grids[0, frame].numpy()[None], unseen_truth(data, np.array([frame]))
        place = np.flatnonzero(targets == frame)
        answer = prediction[place] if len(place) else np.full_like(truth, UNKNOWN)
        found += confusion(truth, answer, left_out, CLASS_COUNT)[0]
    return found


@pytest.mark.parametrize("late", [1, 2, 5])
@pytest.mark.parametrize("move", [True, False])
def test_the_newest_grid_of_a_constant_latency_is_the_plain_row_of_that_lead_to_the_count(data, late, move):
    window = WindowConfig(inputs=1, step_frames=late, target_frame=None)
    model = made(RepeatNewest, given(size=SIZE, inputs=1))
    plan = plan_of(data, late=late, window=window, asked="capture", move=move)
    np.testing.assert_array_equal(streamed(model, plan, move=move), plain(data, model, window, translate=move))


@pytest.mark.parametrize("asked", ["fixed", "known", "exact"])
def test_a_network_asked_for_the_lead_that_its_latency_needs_is_the_plain_row_to_the_count(data, asked):
    window = WindowConfig(inputs=2, step_frames=3, target_frame=None)
    model = made(FuseAll, given(size=SIZE))
    plan = plan_of(data, late=3, window=window, asked=asked)
    np.testing.assert_array_equal(streamed(model, plan, move=True), plain(data, model, window, translate=True))


def test_without_latency_the_newest_grid_is_the_target(data):
    plan = plan_of(data, late=0, window=WindowConfig(inputs=1, target_frame=None))
    counts = streamed(made(RepeatNewest, given(size=SIZE, inputs=1)), plan, move=True)
    assert counts.sum() == np.trace(counts) > 0


def test_six_frames_by_hand():
    """A car drives right, a cell a frame; latency of 1.5 frames, one worker; a cell of ego motion in frame 4.

    The worker answers frame 0 at 1.5, frame 1 at 3, frame 3 at 4.5, frame 4 at 6. So at the captures of 0 to 5 the
    newest grid is: none, none, that of 0, of 1, of 1, of 3.
    """
    grids = np.ones((1, 6, 8, 8), np.uint8)
    for frame in range(6):
        grids[0, frame, 2, frame] = 6
    forward_m = np.array([[0, 0]] * 4 + [[1, 0]] * 2)
    stacked = stack_recordings([recording(grids, position_m=forward_m)], cell_m=1.0)
    data = replace(stacked, stamps_ns=np.arange(6) * 100)
    window, took = WindowConfig(inputs=1, step_frames=1, target_frame=None), 150
    latencies = lambda name, count: np.full(count, took, np.int64)  # noqa: E731
    plan = plan_of(data, late=0, window=window, latencies=latencies, workers="one", asked="capture")
    assert plan.used.tolist() == [-1, -1, 0, 1, 1, 2]
    assert plan.capture_ns.tolist() == [0, 100, 300]
    assert (plan.publish_ns - plan.begin_ns == took).all()
    assert plan.first_answer_ns.tolist() == [took]
    model = made(RepeatNewest, given(size=8, inputs=1))
    spec = GridSpec(rows=8, columns=8, cell_m=1.0, agent_row=8, agent_column=4)
    counted = evaluate_stream(model, plan, spec=spec, move=True)
    found = counted.sums["iou", "all"][:, 0].sum(axis=0)
    # Target road, 63 cells a frame, and one car; two misses. A grid that is two frames old has the car two cells behind
    # and one row too far down after the vehicle has gone a cell ahead, where the first row is then unknown.
    expected = np.zeros((CLASS_COUNT, CLASS_COUNT), np.int64)
    expected[1, UNKNOWN] += 2 * 63
    expected[6, UNKNOWN] += 2
    for car_aside, rows_lost in ((True, 0), (True, 0), (True, 1), (True, 1)):
        expected[1, 6] += car_aside
        expected[6, 1] += car_aside
        expected[1, UNKNOWN] += 8 * rows_lost
        expected[1, 1] += 64 - 2 - 8 * rows_lost
    np.testing.assert_array_equal(found, expected)


def test_grids_are_asked_for_the_middle_of_their_use_when_that_is_known(data):
    plan = plan_of(data, late=3, workers="one", asked="known")
    for number in range(len(plan.for_ns)):
        times = data.stamps_ns[plan.evaluated[plan.used == number]]
        assert plan.for_ns[number] == times[(len(times) - 1) // 2]


@pytest.mark.parametrize(("workers", "spacing"), [("many", 1), ("one", 4)])
def test_answers_are_asked_for_the_middle_of_the_time_in_which_past_ones_were_the_newest(data, workers, spacing):
    """The first ones, which have no past, take the latency of the first for theirs."""
    plan = plan_of(data, late=4, asked="adaptive", workers=workers)
    leads = (plan.for_ns - plan.capture_ns) / FRAME_NS
    np.testing.assert_allclose(leads, 4 + spacing / 2, atol=1e-6)


def test_an_adaptive_stream_learns_what_its_answers_take(data):
    """From the sixth frame on everything takes 6 frames instead of 2; ten answers later that is all it remembers."""
    took = lambda name, count: np.where(np.arange(count) < 6, 2, 6) * FRAME_NS  # noqa: E731
    plan = plan_of(data, late=0, asked="adaptive", latencies=took)
    leads = ((plan.for_ns - plan.capture_ns) / FRAME_NS)[: FRAMES - 8]
    assert leads[0] == pytest.approx(2.5)
    assert leads[-1] > 4
    assert (np.diff(leads) > -0.5).all()


def test_leads_stay_within_what_a_network_can_be_asked_for(data):
    limits_ns = (FRAME_NS, 2 * FRAME_NS)
    for late, lead in ((0, 1), (5, 2)):
        plan = plan_of(data, late=late, asked="known", limits_ns=limits_ns)
        assert set((plan.for_ns - plan.capture_ns) // FRAME_NS) == {lead}


def slow_unseen(data, frame):
    first = int(data.first_frames[data.locate(np.array([frame]))[0][0]])
    seen = np.zeros((SIZE, SIZE), bool)
    for other in range(first, frame + 1):
        shift = np.rint(data.position_m[frame] - data.position_m[other]).astype(int)
        for row, column in np.argwhere(data.grids[0, other].numpy() != UNKNOWN):
            place = row + shift[0], column + shift[1]
            if 0 <= place[0] < SIZE and 0 <= place[1] < SIZE:
                seen[place] = True
    return seen & (data.grids[0, frame].numpy() == UNKNOWN)


def test_the_mask_is_what_any_frame_up_to_then_has_seen(data):
    frames = np.array([0, 7, FRAMES - 1, FRAMES, 2 * FRAMES - 1])
    expected = np.stack([slow_unseen(data, frame) for frame in frames])
    np.testing.assert_array_equal(unseen_truth(data, frames), expected)
    assert expected[0].sum() == 0 < expected[2].sum()


def test_scores_do_not_depend_on_the_batch_and_blocks_add_up_to_all(data):
    plan = plan_of(data, late=2, workers="one", asked="adaptive")
    model = made(FuseAll, given(size=SIZE))
    few, many = (evaluate_stream(model, plan, spec=SPEC, move=True, batch=size).sums for size in (3, 64))
    assert few.keys() == many.keys()
    for key in few:
        np.testing.assert_array_equal(few[key], many[key])
    blocks = plan.blocks()
    assert len(few["iou", "all"]) == blocks[-1] + 1 == 2 * 3  # 1.35 s each
    cells = few["iou", "all"].sum(axis=(1, 2, 3)) + np.bincount(
        blocks, weights=unseen_truth(data, plan.evaluated).sum(axis=(1, 2))
    )
    np.testing.assert_array_equal(cells, np.bincount(blocks) * SIZE**2)


def test_a_rate_takes_the_first_frame_of_each_period():
    stamps_ns = np.array([0, 40, 90, 110, 210, 290, 300]) * 1_000_000 + 7
    assert evaluated_frames(stamps_ns, 10.0).tolist() == [0, 3, 4, 6]
    assert evaluated_frames(stamps_ns, None).tolist() == list(range(7))


def test_positions_are_exact_at_frames_and_go_on_after_the_last():
    stamps_ns, position_m = np.array([10, 20, 40]), np.array([[0.0, 0.1], [1.0, 0.1], [2.0, 0.3]])
    found = positions_at(np.array([10, 15, 20, 40, 60]), stamps_ns, position_m)
    np.testing.assert_array_equal(found[[0, 2, 3]], position_m)
    np.testing.assert_allclose(found[[1, 4]], [[0.5, 0.1], [3.0, 0.5]])


def test_recorded_answers_are_kept_in_the_order_of_their_use(data):
    """Of three in a log, the second is the oldest: what is shown of the first recording begins with it."""
    stamps_ns = data.stamps_ns[:FRAMES]
    places, published = np.array([4, 1, 8]), np.array([6, 2, 10])
    told = Recorded(stamps_ns[places], stamps_ns[places], stamps_ns[published])
    config = StreamConfig(recorded=True)
    window = WindowConfig(inputs=1, step_frames=1, target_frame=None)
    plan = plan_stream(data, [0], config, window, constant(0), sensors=("full",), recorded=lambda name: told)
    assert (plan.numbers.tolist(), (np.diff(plan.used) >= 0).all()) == ([1, 0, 2], True)
    evaluation = evaluate_stream(made(RepeatNewest, given(size=SIZE, inputs=1)), plan, spec=SPEC, move=True, batch=3)
    np.testing.assert_array_equal(evaluation.shown["prediction"], data.grids[0, [1, 4, 8]].numpy())
