"""Windows: the paper's counts, aligned targets, and recordings that are too short."""

import pytest
from support.planned import listed

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.windows.plan import WindowConfig, training_windows, validation_windows


def test_thirty_frames_give_twenty_training_windows():
    plan = training_windows([30], WindowConfig())
    assert len(plan.windows) == 20
    assert listed(plan.windows)[0] == (0, (0, 5), 10)
    assert listed(plan.windows)[-1] == (0, (19, 24), 29)


def test_papers_recordings_give_its_number_of_windows():
    assert len(training_windows([30] * 2975, WindowConfig()).windows) == 59_500
    assert len(validation_windows([30] * 500, WindowConfig()).windows) == 500


@pytest.mark.parametrize(
    ("inputs", "horizon_steps", "expected"),
    [(2, 1, (15, 20)), (5, 1, (0, 5, 10, 15, 20)), (2, 4, (0, 5)), (1, 1, (20,))],
)
def test_validation_windows_of_all_shapes_share_their_target(inputs, horizon_steps, expected):
    config = WindowConfig(inputs=inputs, horizon_steps=horizon_steps)
    assert listed(validation_windows([30, 26], config).windows) == [(0, expected, 25), (1, expected, 25)]


def test_horizon_is_counted_from_the_newest_input():
    config = WindowConfig(inputs=3, step_frames=2, horizon_steps=2, target_frame=None)
    assert listed(validation_windows([10], config).windows) == [(0, (0, 2, 4), 8), (0, (1, 3, 5), 9)]


def test_recordings_take_one_lead_after_the_other_also_where_every_target_counts():
    config = WindowConfig(inputs=1, target_frame=None)
    plan = validation_windows([4, 4, 4, 2, 1], config, (1, 2))
    by_recording = {index: [w for w in listed(plan.windows) if w[0] == index] for index in range(5)}
    assert by_recording[0] == [(0, (target - 1,), target) for target in (1, 2, 3)]
    assert by_recording[1] == [(1, (target - 2,), target) for target in (2, 3)]
    assert by_recording[2] == [(2, (target - 1,), target) for target in (1, 2, 3)]
    assert by_recording[3] == [(3, (0,), 1)]  # too short for the lead whose turn it is
    assert plan.too_short == {4: "has 1 frame, and a window needs 2"}


def test_short_recordings_are_named_and_the_others_go_on():
    plan = training_windows([10, 30, 11], WindowConfig())
    assert set(plan.windows.recording) == {1, 2}
    assert plan.too_short == {0: "has 10 frames, and a window needs 11"}
    assert validation_windows([25, 26], WindowConfig()).too_short == {0: "has 25 frames, and a window needs 26"}


@pytest.mark.parametrize("plan", [training_windows, validation_windows])
def test_no_window_at_all_is_an_error_with_both_numbers(plan):
    with pytest.raises(InputError, match=r"a window needs \d+ frames, and the longest recording \(of 2\) has 10"):
        plan([9, 10], WindowConfig())
    with pytest.raises(InputError, match=r"the longest recording \(of 0\) has 0"):
        plan([], WindowConfig())


def test_target_before_the_first_possible_one_is_a_config_error():
    with pytest.raises(ConfigError, match=r"target_frame 25 is too early: inputs 5, .* reach back 30 frames"):
        parse_config(WindowConfig, {"inputs": 5, "horizon_steps": 2})


@pytest.mark.parametrize("key", ["inputs", "step_frames", "horizon_steps"])
def test_counts_must_be_positive(key):
    with pytest.raises(ConfigError, match=key):
        parse_config(WindowConfig, {key: 0})
