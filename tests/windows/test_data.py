"""Batches: shift and mask against slow twins, gathering by hand, and faults in the data."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from support.planned import listed, planned
from support.recordings import FRAME_NS, random_recording, recording

from semgrid_eval.errors import InputError
from semgrid_eval.windows.data import select_windows, window_arrays
from semgrid_eval.windows.grids import GHOST_S, covered_without_truth, shift_grids, shift_in_cells, stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows, validation_windows

SENSORS = ("full", "upper", "lower")


def slow_shift(grid, rows, columns):
    moved = np.zeros_like(grid)
    for row in range(grid.shape[0]):
        for column in range(grid.shape[1]):
            to_row, to_column = row + rows, column + columns
            if 0 <= to_row < grid.shape[0] and 0 <= to_column < grid.shape[1]:
                moved[to_row, to_column] = grid[row, column]
    return moved


def slow_mask(aligned, target):
    mask = np.zeros(target.shape, bool)
    for b, row, column in np.ndindex(target.shape):
        covered = target[b, row, column] != 0 or (aligned[b, :, :, row, column] != 0).any()
        mask[b, row, column] = covered and target[b, row, column] == 0
    return mask


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    shifts=st.lists(st.tuples(st.integers(-8, 8), st.integers(-8, 8)), min_size=1, max_size=4),
)
def test_shift_equals_moving_cell_by_cell(seed, size, shifts):
    grids = np.random.default_rng(seed).integers(0, 10, (len(shifts), *size), dtype=np.uint8)
    moved = shift_grids(torch.from_numpy(grids), torch.tensor(shifts)).numpy()
    assert moved.dtype == np.uint8
    for grid, shift, result in zip(grids, shifts, moved, strict=True):
        np.testing.assert_array_equal(result, slow_shift(grid, *shift))


@given(seed=st.integers(0, 2**32 - 1), shape=st.tuples(*[st.integers(1, 3)] * 3, *[st.integers(1, 5)] * 2))
def test_mask_equals_the_papers_formula_cell_by_cell(seed, shape):
    random = np.random.default_rng(seed)
    aligned = random.integers(0, 10, shape, dtype=np.uint8) * random.integers(0, 2, shape, dtype=np.uint8)
    target = aligned[:, 0, 0] * random.integers(0, 2, aligned[:, 0, 0].shape, dtype=np.uint8)
    mask = covered_without_truth(torch.from_numpy(aligned), torch.from_numpy(target))
    np.testing.assert_array_equal(mask.numpy(), slow_mask(aligned, target))


def test_content_comes_nearer_and_right_when_driving_forward_and_left():
    assert shift_in_cells(np.array([2.0, 1.0]), 0.78125).tolist() == [3, 1]
    assert shift_in_cells(np.array([-2.0, -1.0]), 0.78125).tolist() == [-3, -1]


def test_shift_rounds_the_whole_way_once():
    steps = np.array([[0.4, 0.0]] * 3)
    assert shift_in_cells(steps.sum(axis=0), 1.0).tolist() == [1, 0]
    assert shift_in_cells(steps, 1.0).sum(axis=0).tolist() == [0, 0]


def test_pole_seen_by_a_moving_vehicle_stays_where_it_is():
    pole_m = np.array([12.0, 3.0])  # forward, left of the origin
    position_m = np.array([[0.0, 0.0], [2.0, -1.0], [5.0, 1.0]])
    grids = np.zeros((1, 3, 16, 16), np.uint8)
    for frame, (forward_m, left_m) in enumerate(pole_m - position_m):
        grids[0, frame, int(15 - forward_m), int(8 - left_m)] = 5
    data = stack_recordings([recording(grids, position_m=position_m)], cell_m=1.0)
    batch = select_windows(data, planned((0, (0, 1), 2)), sensors=["full"]).batch(slice(0, 1))
    assert batch.shift_cells.tolist() == [[[5, 1], [3, 2]]]
    assert torch.equal(batch.past[0, 0, 0], batch.target[0])
    assert torch.equal(batch.past[0, 0, 1], batch.target[0])


def test_frames_are_found_in_their_recordings():
    lengths = [3, 1, 4]
    data = stack_recordings([random_recording(i, frames=count) for i, count in enumerate(lengths)], cell_m=0.5)
    expected = [(owner, frame) for owner, count in enumerate(lengths) for frame in range(count)]
    owners, frames = data.locate(np.arange(8))
    assert list(zip(owners.tolist(), frames.tolist(), strict=True)) == expected


@pytest.mark.parametrize("translate", [True, False])
def test_batch_holds_the_frames_of_its_windows(translate):
    recordings = [random_recording(seed, frames=14 + seed, sensors=SENSORS) for seed in range(3)]
    data = stack_recordings(recordings, cell_m=0.5)
    plan = training_windows(data.frame_counts, WindowConfig())
    windows = select_windows(data, plan.windows, sensors=["lower", "upper"], translate=translate)
    chosen = torch.tensor([0, len(windows) - 1, 5, 5])
    batch = windows.batch(chosen)
    for row, number in enumerate(chosen.tolist()):
        owner, inputs, target = listed(plan.windows)[number]
        source = recordings[owner]
        assert np.array_equal(batch.target[row], source.grids[0, target])
        aligned = np.empty((1, 2, 2, 16, 16), np.uint8)
        for t, frame in enumerate(inputs):
            shift = np.rint((source.position_m[target] - source.position_m[frame]) / 0.5).astype(int)
            assert batch.shift_cells[row, t].tolist() == shift.tolist()
            for s, name in enumerate(("lower", "upper")):
                grid = source.grids[SENSORS.index(name), frame]
                aligned[0, s, t] = slow_shift(grid, *shift)
                assert np.array_equal(batch.past[row, s, t], aligned[0, s, t] if translate else grid)
        assert np.array_equal(batch.mask[row], slow_mask(aligned, batch.target[row : row + 1].numpy())[0])
    assert batch.lead_s[0].tolist() == pytest.approx([10 * FRAME_NS * 1e-9, 5 * FRAME_NS * 1e-9])


def test_rows_without_translation_are_masked_like_those_with_it():
    data = stack_recordings([random_recording(3)], cell_m=0.5)
    plan = validation_windows(data.frame_counts, WindowConfig())
    moved, still = (
        select_windows(data, plan.windows, sensors=["full"], translate=translate).batch(slice(None))
        for translate in (True, False)
    )
    assert not torch.equal(moved.past, still.past)
    assert torch.equal(moved.mask, still.mask)


def test_window_arrays_are_aligned_and_do_not_depend_on_the_batch():
    data = stack_recordings([random_recording(seed, sensors=SENSORS) for seed in range(5)], cell_m=0.5)
    plan = validation_windows(data.frame_counts, WindowConfig(inputs=3))
    windows = select_windows(data, plan.windows, sensors=["upper", "lower"], translate=False)
    arrays, again = window_arrays(windows, batch=2), window_arrays(windows, batch=64)
    assert {name: array.shape for name, array in arrays.items()} == {
        "inputs": (5, 2, 3, 16, 16),
        "target": (5, 16, 16),
        "mask": (5, 16, 16),
    }
    assert all(np.array_equal(arrays[name], again[name]) for name in arrays)
    aligned = select_windows(data, plan.windows, sensors=["upper", "lower"]).batch(slice(None))
    assert np.array_equal(arrays["inputs"], aligned.past)


def slow_flags(source, target):
    """Footprints of every frame of the last second and a half, moved one after the other."""
    expected = np.zeros(source.actors.shape[1:], np.uint8)
    for frame in range(target + 1):
        if source.stamps_ns[target] - source.stamps_ns[frame] <= GHOST_S * 1e9:
            shift = np.rint((source.position_m[target] - source.position_m[frame]) / 0.5).astype(int)
            expected |= slow_shift(source.actors[frame], *shift)
    return expected


def test_actors_lie_at_the_target_and_where_they_were_before_it():
    recordings = [random_recording(seed, truth=seed != 1) for seed in range(3)]
    data = stack_recordings(recordings, cell_m=0.5)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=1, step_frames=2))
    windows = select_windows(data, plan.windows, sensors=["full"])
    flags = np.concatenate([windows.actors(slice(start, start + 7)) for start in range(0, len(windows), 7)])
    for (owner, _, target), found in zip(listed(plan.windows), flags, strict=True):
        source = recordings[owner]
        nothing = np.zeros((16, 16), np.uint8)
        expected = nothing if source.actors is None else slow_flags(source, target)
        np.testing.assert_array_equal(found, expected)
    assert np.array_equal(window_arrays(windows)["actors"], flags)


def test_actors_are_the_same_whatever_a_row_sees():
    data = stack_recordings([random_recording(3, sensors=SENSORS, truth=True)], cell_m=0.5)
    rows = [(2, 1, ["full"], True), (5, 1, ["full"], True), (2, 4, ["full"], True), (2, 1, ["upper", "lower"], False)]
    found = []
    for inputs, horizon_steps, sensors, translate in rows:
        config = WindowConfig(inputs=inputs, horizon_steps=horizon_steps)
        plan = validation_windows(data.frame_counts, config)
        windows = select_windows(data, plan.windows, sensors=sensors, translate=translate)
        found.append(windows.actors(slice(None)))
        reach_ns = data.stamps_ns[25] - data.stamps_ns[plan.windows.frames[0, 0]]
        assert reach_ns <= GHOST_S * 1e9, "the ghosts of all rows of the paper lie inside"
    assert found[0].any()
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_without_the_truth_there_are_no_actors():
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    windows = select_windows(data, planned((0, (0, 5), 10)), sensors=["full"])
    assert windows.actors(slice(0, 1)) is None
    assert "actors" not in window_arrays(windows)


def test_only_needed_sensors_are_kept():
    data = stack_recordings([random_recording(0, sensors=SENSORS)], cell_m=0.5, sensors=["lower"])
    assert data.sensors == ("lower", "full")
    assert data.grids.shape == (2, 30, 16, 16)


def test_the_target_may_be_another_sensor():
    recordings = [replace(random_recording(0, sensors=SENSORS), target="upper")]
    data = stack_recordings(recordings, cell_m=0.5, sensors=["lower"])
    assert data.sensors == ("lower", "upper")
    batch = select_windows(data, planned((0, (0, 5), 10)), sensors=["lower"]).batch(slice(None))
    assert np.array_equal(batch.target[0], recordings[0].grids[1, 10])


def test_digest_tells_windows_apart():
    data = stack_recordings([random_recording(0, sensors=SENSORS)], cell_m=0.5)
    plan = training_windows(data.frame_counts, WindowConfig())
    base = select_windows(data, plan.windows, sensors=["full"])
    same = select_windows(data, plan.windows, sensors=["full"])
    others = [
        select_windows(data, plan.windows[1:], sensors=["full"]),
        select_windows(data, plan.windows, sensors=["lower"]),
        select_windows(data, plan.windows, sensors=["full"], translate=False),
        select_windows(stack_recordings([random_recording(1)], cell_m=0.5), plan.windows, sensors=["full"]),
    ]
    assert base.digest() == same.digest()
    assert len({base.digest(), *(other.digest() for other in others)}) == 5


def test_faults_name_recording_and_sensor():
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    with pytest.raises(InputError, match="no sensor 'rear', only full"):
        select_windows(data, planned((0, (0,), 5)), sensors=["rear"])
    with pytest.raises(InputError, match="no windows"):
        select_windows(data, planned((0, (0, 5), 10))[:0], sensors=["full"])
    with pytest.raises(InputError, match="random 1 have no sensor 'upper', only full"):
        stack_recordings([random_recording(0, sensors=SENSORS), random_recording(1)], cell_m=0.5)
    with pytest.raises(InputError, match=r"random 1 are \(8, 8\), and the first ones are \(16, 16\)"):
        stack_recordings([random_recording(0), random_recording(1, size=8)], cell_m=0.5)
    with pytest.raises(InputError, match="no grids"):
        stack_recordings([], cell_m=0.5)
