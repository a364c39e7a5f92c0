import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage
from semgrid_eval.grids.geometry import ground_rays
from support.cameras import calibration, slow_point

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, CLASSES, NO_POINT
from semgrid_eval.grids.rasterise import LabelledImage, count_points, rasterise
from semgrid_eval.grids.spec import GridSpec

ROAD, SIDEWALK, POLE, CAR, PERSON = (CLASS_NAMES.index(n) for n in ("road", "sidewalk", "pole_sign", "car", "person"))
SMALL = GridSpec(rows=16, columns=16, cell_m=2.0, agent_row=16, agent_column=8)


def slow_counts(image, camera, yaw_rad, crops, spec):
    """One pixel after the other, with nothing but school geometry."""
    counts = np.zeros((len(crops), CLASS_COUNT, spec.rows, spec.columns), int)
    height, width = image.classes.shape
    for v in range(height):
        for u in range(width):
            label, value = int(image.classes[v, u]), int(image.disparity[v, u])
            if label == NO_POINT or value <= 1:
                continue
            depth_m = camera.fx_px * camera.baseline_m / ((value - 1) / 256)
            x, y = slow_point(camera, u, v, depth_m)
            c, s = math.cos(yaw_rad), math.sin(yaw_rad)
            forward, left = c * x - s * y, s * x + c * y
            row = spec.agent_row - 1 - math.floor(forward / spec.cell_m)
            column = spec.agent_column - 1 - math.floor(left / spec.cell_m)
            if 0 <= row < spec.rows and 0 <= column < spec.columns:
                for s_, (top, bottom, left_px, right_px) in enumerate(crops):
                    if top <= v < bottom and left_px <= u < right_px:
                        counts[s_, label, row, column] += 1
    return counts


@settings(max_examples=60)
@given(
    arrays(np.uint8, (6, 8), elements=st.sampled_from([0, 1, 5, 9, NO_POINT])),
    arrays(np.uint16, (6, 8), elements=st.integers(0, 400)),
    st.floats(-3.0, 3.0),
    st.floats(-0.2, 0.2),
)
def test_counts_match_a_pixel_by_pixel_twin(classes, disparity, yaw_rad, pitch_rad):
    camera = calibration(fx_px=8.0, fy_px=8.1, u0_px=3.9, v0_px=2.8, pitch_rad=pitch_rad)
    image = LabelledImage(classes, disparity)
    crops = np.array([[0, 6, 0, 8], [1, 4, 2, 7]])
    rays = ground_rays(camera, (8, 6), (8, 6))
    fast = count_points(image, rays, yaw_rad, crops, SMALL)
    np.testing.assert_array_equal(fast, slow_counts(image, camera, yaw_rad, crops, SMALL))


def slow_decision(counts, layers):
    grid = np.zeros(counts.shape[1:], np.uint8)
    for cell in np.ndindex(*grid.shape):
        known = [c for c in range(1, CLASS_COUNT) if layers[(c, *cell)]]
        if known:
            grid[cell] = min(known, key=lambda c: (-CLASSES[c].category, -counts[(c, *cell)], c))
    return grid


def slow_rasterise(counts):
    grid = slow_decision(counts, counts > 0)
    layers = np.zeros(counts.shape, bool)
    for class_id in range(1, CLASS_COUNT):
        sizes = (3, 2, 4, 4) if CLASSES[class_id].category == 0 else (1, 1, 2, 2)
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
    np.testing.assert_array_equal(rasterise(counts), slow_rasterise(counts))


def test_small_and_dynamic_classes_win_over_many_points_of_static_ones():
    counts = np.zeros((CLASS_COUNT, 4, 4), np.int32)
    counts[ROAD], counts[SIDEWALK] = 5, 6
    counts[POLE, 0], counts[CAR, 1], counts[PERSON, 2] = 1, 1, 1
    counts[POLE, 1:3], counts[CAR, 2] = 9, 9
    grid = rasterise(counts, "off")
    assert [set(row) for row in grid] == [{POLE}, {CAR}, {PERSON}, {SIDEWALK}]


def test_equal_counts_of_equal_priority_go_to_the_lower_id():
    counts = np.zeros((CLASS_COUNT, 2, 2), np.int32)
    counts[ROAD] = counts[SIDEWALK] = 3
    assert (rasterise(counts, "off") == ROAD).all()


def test_even_kernels_do_not_shift_small_objects():
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[CAR, 5:9, 7:12] = 1
    np.testing.assert_array_equal(rasterise(counts), rasterise(counts, "off"))
    shifted = rasterise(counts, "opencv") == CAR
    assert ndimage.center_of_mass(shifted) == pytest.approx((7.5, 10.0))  # plain OpenCV: one cell down and right


@given(st.integers(0, 2**32 - 1))
def test_opening_of_small_classes_is_anti_extensive(seed):
    rng = np.random.default_rng(seed)
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[CAR] = rng.random((20, 20)) < 0.6
    assert not ((rasterise(counts) == CAR) & (counts[CAR] == 0)).any()


def test_a_lone_cell_of_a_small_class_is_filtered_and_two_by_two_stay():
    counts = np.zeros((CLASS_COUNT, 20, 20), np.int32)
    counts[POLE, 3, 3] = 1
    counts[POLE, 10:12, 10:12] = 1
    assert (rasterise(counts) == POLE).sum() == 4


@pytest.mark.parametrize("yaw_deg", [-30, 0, 30])
@pytest.mark.parametrize("pitch_rad", [-0.05, 0.0, 0.038])
@pytest.mark.parametrize("camera_yaw_rad", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("left_m", [-5.0, 5.0])
def test_a_pole_lands_in_the_cell_that_the_arithmetic_says(yaw_deg, pitch_rad, camera_yaw_rad, left_m):
    camera = calibration(pitch_rad=pitch_rad, yaw_rad=camera_yaw_rad)
    spec = GridSpec()
    u, v, disparity = pixel_of(camera, 20.0, left_m, 1.0)
    classes = np.full((256, 512), NO_POINT, np.uint8)
    values = np.zeros((256, 512), np.uint16)
    classes[v, u], values[v, u] = POLE, disparity
    rays = ground_rays(camera, (512, 256), (512, 256))
    counts = count_points(
        LabelledImage(classes, values), rays, math.radians(yaw_deg), np.array([[0, 256, 0, 512]]), spec
    )
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    forward, left = 20.0 * c - left_m * s, 20.0 * s + left_m * c
    expected = (127 - math.floor(forward / 0.78125), 63 - math.floor(left / 0.78125))
    assert np.argwhere(counts[0, POLE]).tolist() == [list(expected)]


def test_pole_20_m_ahead_and_5_m_left_is_row_102_column_57():
    camera = calibration()
    u, v, disparity = pixel_of(camera, 20.0, 5.0, 1.0)
    image = LabelledImage(np.full((256, 512), NO_POINT, np.uint8), np.zeros((256, 512), np.uint16))
    image.classes[v, u], image.disparity[v, u] = POLE, disparity
    rays = ground_rays(camera, (512, 256), (512, 256))
    counts = count_points(image, rays, 0.0, np.array([[0, 256, 0, 512]]), GridSpec())
    assert np.argwhere(counts[0, POLE]).tolist() == [[102, 57]]


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
