import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from support.cameras import calibration

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, DEFAULT_CLASSES, NO_POINT
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import add_points, grid_of, no_points, rasterise
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.sensors.projection import Projection
from semgrid_eval.sensors.sensor import Points, SensorConfig

ROAD, SIDEWALK, POLE, CAR, PERSON = (CLASS_NAMES.index(n) for n in ("road", "sidewalk", "pole_sign", "car", "person"))
PRIORITY = [1, 1, 1, 1, 1, 2, 3, 3, 4, 4]  # of unknown it does not matter
SMALL = GridSpec(rows=16, columns=16, cell_m=2.0, agent_row=16, agent_column=8)


TURN = st.builds(SE2, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


def points_of(forward_m, left_m, class_id):
    return Points("any", 0, np.asarray(forward_m, float), np.asarray(left_m, float), np.asarray(class_id, np.uint8))


def counted(points, grid_from_points, spec):
    counts = no_points(GridConfig(spec=spec))
    add_points(counts, points, grid_from_points, spec)
    return counts


def slow_counts(points, move, spec):
    """One point after the other, with nothing but school geometry."""
    counts = np.zeros((CLASS_COUNT, spec.rows, spec.columns), int)
    flat = zip(points.forward_m.ravel(), points.left_m.ravel(), points.class_id.ravel(), strict=True)
    for x, y, label in flat:
        if label != NO_POINT:
            c, s = math.cos(move.yaw_rad), math.sin(move.yaw_rad)
            row = spec.agent_row - 1 - math.floor((c * x - s * y + move.x_m) / spec.cell_m)
            column = spec.agent_column - 1 - math.floor((s * x + c * y + move.y_m) / spec.cell_m)
            if 0 <= row < spec.rows and 0 <= column < spec.columns:
                counts[label, row, column] += 1
    return counts


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(40,), (5, 8), (0,)]), TURN)
def test_counts_match_a_point_by_point_twin(seed, shape, move):
    random = np.random.default_rng(seed)
    places_m, classes = random.uniform(-40, 40, (2, *shape)), random.choice([0, 1, 5, 9, NO_POINT], shape)
    points = points_of(*places_m, classes)
    np.testing.assert_array_equal(counted(points, move, SMALL), slow_counts(points, move, SMALL))


def test_points_of_several_sensors_are_added_and_a_part_of_an_image_is_counted_alone():
    whole = points_of(np.full((4, 6), 9.0), np.full((4, 6), 1.0), np.full((4, 6), ROAD))
    part = points_of(whole.forward_m[1:3, 2:5], whole.left_m[1:3, 2:5], whole.class_id[1:3, 2:5])
    counts = counted(whole, SE2(0.0, 0.0, 0.0), SMALL)
    add_points(counts, part, SE2(0.0, 0.0, 0.0), SMALL)
    assert np.argwhere(counts).tolist() == [[ROAD, 11, 7]]
    assert counts[ROAD, 11, 7] == 24 + 6


def slow_decision(counts, layers):
    grid = np.zeros(counts.shape[1:], np.uint8)
    for cell in np.ndindex(*grid.shape):
        known = [c for c in range(1, CLASS_COUNT) if layers[(c, *cell)]]
        if known:
            grid[cell] = min(known, key=lambda c: (-PRIORITY[c], -counts[(c, *cell)], c))
    return grid


def slow_rasterise(counts):
    grid = slow_decision(counts, counts > 0)
    layers = np.zeros(counts.shape, bool)
    for class_id in range(1, CLASS_COUNT):
        sizes = (3, 2, 4, 4) if DEFAULT_CLASSES.classes[class_id].category == "static" else (1, 1, 2, 2)
        layer = grid == class_id
        # The erosion of a cell looks at offsets -k//2 ... of it; outside the grid nothing erodes and nothing grows.
        layer = spread(layer, sizes[0], reflect=True)
        layer = ~spread(~layer, sizes[1], reflect=False)
        layer = ~spread(~layer, sizes[2], reflect=False)
        layers[class_id] = spread(layer, sizes[3], reflect=True)
    return slow_decision(counts, layers)


def spread(layer, size, *, reflect):
    """True where any of size x size neighbours is True, the neighbours listed by hand."""
    offsets = [o - size // 2 for o in range(size)]
    if reflect:
        offsets = [-o for o in offsets]
    rows, columns = layer.shape
    result = np.zeros_like(layer)
    for r, c in np.ndindex(rows, columns):
        result[r, c] = any(
            0 <= r + dr < rows and 0 <= c + dc < columns and layer[r + dr, c + dc] for dr in offsets for dc in offsets
        )
    return result


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.02, 0.5))
def test_morphology_and_priorities_match_a_slow_twin(seed, density):
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 4, (CLASS_COUNT, 14, 14)) * (rng.random((CLASS_COUNT, 14, 14)) < density)
    counts = counts.astype(np.int32)
    np.testing.assert_array_equal(rasterise(counts, DEFAULT_CLASSES), slow_rasterise(counts))


def test_small_and_dynamic_classes_win_over_many_points_of_static_ones():
    counts = np.zeros((CLASS_COUNT, 4, 4), np.int32)
    counts[ROAD], counts[SIDEWALK] = 5, 6
    counts[POLE, 0], counts[CAR, 1], counts[PERSON, 2] = 1, 1, 1
    counts[POLE, 1:3], counts[CAR, 2] = 9, 9
    grid = rasterise(counts, DEFAULT_CLASSES, "off")
    assert [set(row) for row in grid] == [{POLE}, {CAR}, {PERSON}, {SIDEWALK}]


def test_equal_counts_of_equal_priority_go_to_the_lower_id():
    counts = np.zeros((CLASS_COUNT, 2, 2), np.int32)
    counts[ROAD] = counts[SIDEWALK] = 3
    assert (rasterise(counts, DEFAULT_CLASSES, "off") == ROAD).all()


def test_even_kernels_do_not_shift_small_objects():
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[CAR, 5:9, 7:12] = 1
    np.testing.assert_array_equal(rasterise(counts, DEFAULT_CLASSES), rasterise(counts, DEFAULT_CLASSES, "off"))
    shifted = rasterise(counts, DEFAULT_CLASSES, "opencv") == CAR
    assert ndimage.center_of_mass(shifted) == pytest.approx((7.5, 10.0))  # plain OpenCV: one cell down and right


@given(st.integers(0, 2**32 - 1))
def test_opening_of_small_classes_is_anti_extensive(seed):
    rng = np.random.default_rng(seed)
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[CAR] = rng.random((20, 20)) < 0.6
    assert not ((rasterise(counts, DEFAULT_CLASSES) == CAR) & (counts[CAR] == 0)).any()


def test_a_lone_cell_of_a_small_class_is_filtered_and_two_by_two_stay():
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[POLE, 3, 3] = 1
    counts[POLE, 10:12, 10:12] = 1
    assert (rasterise(counts, DEFAULT_CLASSES) == POLE).sum() == 4


def road_with_gap(gap_m, cell_m):
    """Class ids (H, W) of a grid over a road that nothing is seen of for `gap_m`."""
    spec = GridSpec(rows=64, columns=64, cell_m=cell_m, agent_row=64, agent_column=32)
    x, y = np.meshgrid(np.arange(0.05, 64 * cell_m, 0.1), np.arange(0.05, 64 * cell_m, 0.1) - 32 * cell_m)
    is_seen = np.abs(x - 32 * cell_m) > gap_m / 2
    return rasterise(
        counted(points_of(x, y, np.where(is_seen, ROAD, NO_POINT)), SE2(0.0, 0.0, 0.0), spec), DEFAULT_CLASSES
    )


@pytest.mark.parametrize("cell_m", [0.8, 0.4])
def test_kernels_are_cells_so_that_a_finer_grid_bridges_shorter_gaps(cell_m):
    assert DEFAULT_CLASSES.kernels_cells(ROAD)[0] == 3
    bridged = [gap for gap in (2, 4, 6) if (road_with_gap(gap * cell_m, cell_m)[20:44, 20:44] == ROAD).all()]
    assert bridged == [2], "a dilation by 3 cells reaches one cell from either side, 1.6 m at most or 0.8 m"


@pytest.mark.parametrize("yaw_deg", [-30, 0, 30])
@pytest.mark.parametrize("pitch_rad", [-0.05, 0.0, 0.038])
@pytest.mark.parametrize("camera_yaw_rad", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("left_m", [-5.0, 5.0])
def test_a_pole_lands_in_the_cell_that_the_arithmetic_says(yaw_deg, pitch_rad, camera_yaw_rad, left_m):
    camera = calibration(pitch_rad=pitch_rad, yaw_rad=camera_yaw_rad)
    spec = GridSpec()
    u, v, disparity = pixel_of(camera, 20.0, left_m, 1.0)
    counts = counted(seen(camera, u, v, disparity), SE2(0.0, 0.0, math.radians(yaw_deg)), spec)
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    forward, left = 20.0 * c - left_m * s, 20.0 * s + left_m * c
    expected = (127 - math.floor(forward / 0.78125), 63 - math.floor(left / 0.78125))
    assert np.argwhere(counts[POLE]).tolist() == [list(expected)]


def test_pole_20_m_ahead_and_5_m_left_is_row_102_column_57():
    camera = calibration()
    u, v, disparity = pixel_of(camera, 20.0, 5.0, 1.0)
    counts = counted(seen(camera, u, v, disparity), SE2(0.0, 0.0, 0.0), GridSpec())
    assert np.argwhere(counts[POLE]).tolist() == [[102, 57]]


def seen(camera, u, v, disparity):
    """What a camera sees that has a pole in one pixel and nothing in all others."""
    image = np.zeros((256, 512), np.uint16)
    image[v, u] = disparity
    table = np.full(256, POLE, np.uint8)
    return points_of(*Projection(camera, (512, 256), table).points(image, np.zeros((256, 512), np.uint8)))


def pixel_of(camera, forward_m, left_m, up_m):
    """Project a point of the vehicle frame into the image, rounding to a pixel (20 m away: 2 cm)."""
    x, y, z = forward_m - camera.x_m, left_m - camera.y_m, up_m - camera.z_m
    c, s = math.cos(camera.yaw_rad), math.sin(camera.yaw_rad)
    x, y = c * x + s * y, -s * x + c * y
    c, s = math.cos(camera.pitch_rad), math.sin(camera.pitch_rad)
    x, z = c * x - s * z, s * x + c * z
    u = round(camera.u0_px - camera.fx_px * y / x)
    v = round(camera.v0_px - camera.fy_px * z / x)
    return u, v, round(camera.fx_px * camera.baseline_m / x * 256 + 1)


class Anything(SensorConfig):
    """A sensor with settings that all have."""

    kind: str = "any"


def grid_with(morphologies, *seen):
    """Make a grid of what sensors `a`, `b`, ... saw, each with a morphology of its own, in a grid that has `opencv`."""
    sensors = {name: Anything(morphology=each) for name, each in zip("ab", morphologies, strict=False)}
    spec = GridSpec(rows=16, columns=16, cell_m=1.0, agent_row=16, agent_column=8)
    config = GridConfig.model_construct(spec=spec, sensors=sensors, morphology="opencv")
    named = [replace(points, sensor=name) for points, name in zip(seen, "ab", strict=False)]
    return grid_of([(points, SE2(0.0, 0.0, 0.0)) for points in named], config)


def line(left_m, class_id):
    """A line of one cell along the street."""
    ahead_m = np.arange(0.5, 16.0)
    return points_of(ahead_m, np.full(len(ahead_m), left_m), np.full(len(ahead_m), class_id))


def test_cells_are_filtered_as_their_own_sensor_asks():
    thin, block = line(-3.5, ROAD), points_of(*np.mgrid[0.5:16.0, 0.5:8.0].reshape(2, -1), np.full(16 * 8, SIDEWALK))
    kept = grid_with(["off", "minkowski"], thin, block)
    assert (kept[:, 11] == ROAD).all()
    assert (kept[4:12, 2:6] == SIDEWALK).all()
    lost = grid_with(["minkowski", "minkowski"], thin, block)
    assert not (lost == ROAD).any()
    np.testing.assert_array_equal(kept == SIDEWALK, lost == SIDEWALK)


def test_sensors_of_one_morphology_are_filtered_together_and_none_takes_the_grids():
    left, right = (
        points_of(*np.mgrid[0.5:16.0, low:high].reshape(2, -1), np.full(32, ROAD))
        for low, high in ((0.5, 2.0), (2.5, 4.0))
    )
    for name in ("minkowski", "opencv"):
        assert (grid_with([name, name], left, right)[6:10, 5:7] == ROAD).all(), "four cells wide together"
        assert not (grid_with([name], left) == ROAD).any(), "two cells wide alone"
    np.testing.assert_array_equal(grid_with([None, "opencv"], left, right), grid_with(["opencv"] * 2, left, right))


def test_of_two_sensors_the_class_with_more_points_of_both_wins():
    twice, once = points_of([0.5, 0.5], [0.5, 0.5], [ROAD, SIDEWALK]), points_of([0.5], [0.5], [SIDEWALK])
    assert grid_with(["off", "minkowski"], twice, once)[15, 7] == SIDEWALK
