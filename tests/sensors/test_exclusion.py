import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.cameras import calibration

from semgrid_eval.classes import NO_POINT
from semgrid_eval.recording.resizing import nearest_indices
from semgrid_eval.sensors.exclusion import Exclusion, beside_steps, near_borders
from semgrid_eval.sensors.projection import Projection


def picture(*lines):
    return np.array([[letter == "x" for letter in line] for line in lines])


def neighbours(image, v, u, reach):
    """All pixels at most so many rows and columns away, the pixel itself among them."""
    return image[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1].ravel().tolist()


def slow_borders(class_id, reach_px):
    found = np.zeros(class_id.shape, bool)
    for v, u in np.ndindex(class_id.shape):
        found[v, u] = len(set(neighbours(class_id, v, u, reach_px))) > 1
    return found


def slow_steps(disparity, step_px, source_px=1.0):
    found = np.zeros(disparity.shape, bool)
    for v, u in np.ndindex(disparity.shape):
        for other in neighbours(disparity, v, u, 1):
            if disparity[v, u] > 0 and other > 0:
                found[v, u] |= abs(int(disparity[v, u]) - int(other)) / 256 / source_px > step_px
    return found


def test_a_border_has_its_pixels_on_both_sides_and_the_image_s_edge_has_none():
    classes = np.ones((5, 8), np.uint8)
    classes[:, 5:] = 6
    np.testing.assert_array_equal(near_borders(classes, 1), picture(*["....xx.."] * 5))
    np.testing.assert_array_equal(near_borders(classes, 2), picture(*["...xxxx."] * 5))
    assert not near_borders(classes, 0).any()


def test_a_single_pixel_of_another_class_takes_its_surroundings_with_it():
    classes = np.full((5, 6), NO_POINT, np.uint8)  # such as a pole before the sky
    classes[2, 2] = 5
    expected = picture("......", ".xxx..", ".xxx..", ".xxx..", "......")
    np.testing.assert_array_equal(near_borders(classes, 1), expected)


def coded(disparity_px):
    return (np.asarray(disparity_px, np.float64) * 256 + 1).astype(np.uint16)


def test_a_step_is_where_a_neighbour_s_disparity_differs_by_more():
    near_and_far = coded([[10.0] * 3 + [8.0] * 3] * 3)
    np.testing.assert_array_equal(beside_steps(near_and_far, 1.9), picture(*["..xx.."] * 3))
    assert not beside_steps(near_and_far, 2.0).any(), "exactly the step is not more"


def test_a_step_counts_in_pixels_of_the_resized_image():
    near_and_far = coded([[40.0] * 3 + [32.0] * 3] * 3)  # measured in an image four times as wide
    assert beside_steps(near_and_far, 1.9, source_px=4.0).any()
    assert not beside_steps(near_and_far, 2.0, source_px=4.0).any()


def test_what_was_not_measured_makes_no_step_and_what_is_infinitely_far_does():
    values = coded([[10.0] * 5, [10.0] * 5])
    values[:, 2] = 0
    assert not beside_steps(values, 0.01).any()
    values[:, 2] = 1
    np.testing.assert_array_equal(beside_steps(values, 9.9), picture(".xxx.", ".xxx."))


def test_flat_ground_has_no_step_however_far_it_reaches():
    camera = calibration()
    below_horizon = np.arange(1, 100)
    depth_m = camera.fy_px * camera.z_m / below_horizon
    ground = np.repeat(coded(camera.fx_px * camera.baseline_m / depth_m)[:, None], 4, axis=1)
    assert depth_m.max() > 500
    assert not beside_steps(ground, 0.2).any()
    assert beside_steps(ground, 0.15).all(), "it grows by .171 px from row to row"


images = st.tuples(st.integers(1, 6), st.integers(1, 6))


@settings(max_examples=60)
@given(arrays(np.uint8, images, elements=st.sampled_from([1, 6, NO_POINT])), st.integers(0, 3))
def test_borders_match_a_slow_twin(classes, reach_px):
    np.testing.assert_array_equal(near_borders(classes, reach_px), slow_borders(classes, reach_px))


@settings(max_examples=60)
@given(
    arrays(np.uint16, images, elements=st.sampled_from([0, 1, 2, 256, 300, 513, 65535])),
    st.sampled_from([0.5, 1.0, 2.0]),
)
def test_steps_match_a_slow_twin(disparity, step_px):
    np.testing.assert_array_equal(beside_steps(disparity, step_px, 0.5), slow_steps(disparity, step_px, 0.5))


@pytest.mark.parametrize("exclusion", [Exclusion(), Exclusion(1), Exclusion(0, 3.0), Exclusion(1, 0.5)])
def test_points_of_excluded_pixels_alone_are_left_out(exclusion):
    random = np.random.default_rng(5)
    label = np.kron(random.integers(0, 34, (4, 6)), np.ones((6, 6))).astype(np.uint8)
    disparity = np.kron(random.integers(0, 5000, (3, 4)), np.ones((10, 10))).astype(np.uint16)  # of another size
    table = random.choice([1, 5, 9, NO_POINT], 256).astype(np.uint8)
    size_px = (17, 13)
    plain = Projection(calibration(), size_px, table).points(disparity, label)
    found = Projection(calibration(), size_px, table, exclusion).points(disparity, label)

    def resized(image):
        return image[np.ix_(nearest_indices(image.shape[0], 13), nearest_indices(image.shape[1], 17))]

    expected = slow_borders(table[resized(label)], exclusion.border_px)
    if exclusion.depth_step_px is not None:
        expected |= slow_steps(resized(disparity), exclusion.depth_step_px, 40 / 17)
    assert expected.any() == bool(exclusion)
    np.testing.assert_array_equal(found.class_id, np.where(expected, NO_POINT, plain.class_id))
    used = found.class_id != NO_POINT
    np.testing.assert_array_equal(found.forward_m[used], plain.forward_m[used])
