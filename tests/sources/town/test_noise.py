import numpy as np
import pytest

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.noise import DisparityErrors, DisparityNoise, LabelErrors, LabelNoise

SHAPE = (128, 256)
QUIET = {
    "correlated_px": 0.0,
    "slow_px": 0.0,
    "white_px": 0.0,
    "mismatched": 0.0,
    "dropout": 0.0,
    "far_dropout": 0.0,
    "speckle": 0.0,
    "fattened": 0.0,
    "sky": 0.0,
}


def errors(seed: int = 0, **changes) -> DisparityErrors:
    return DisparityErrors(DisparityNoise(**{**QUIET, **changes}), np.random.default_rng(seed))


def plane(value: float = 8.0):
    return np.full(SHAPE, value, np.float32)


def step():
    """A near object (12 px) over columns 100 to 149 before a background at 4 px."""
    disparity = plane(4.0)
    disparity[:, 100:150] = 12.0
    return disparity


def test_without_errors_nothing_changes():
    np.testing.assert_array_equal(errors().add(plane()), plane())


@pytest.mark.parametrize("part", ["correlated_px", "slow_px", "white_px"])
def test_each_error_has_its_deviation_scaled_from_full_resolution(part):
    found = np.array([errors(seed, **{part: 0.8}).add(plane()) - 8.0 for seed in range(12)])
    assert found.std() == pytest.approx(0.8 * SHAPE[1] / 2048, rel=0.15)


def test_smooth_errors_agree_between_neighbours_and_white_ones_do_not():
    def neighbours(**noise):
        found = errors(**noise).add(plane()) - 8.0
        return np.corrcoef(found[:, 1:].ravel(), found[:, :-1].ravel())[0, 1]

    assert neighbours(correlated_px=1.0) > 0.7
    assert abs(neighbours(white_px=1.0)) < 0.05


def test_slow_errors_are_carried_from_frame_to_frame():
    slow, fresh = errors(slow_px=1.0), errors(correlated_px=1.0)
    first, second = (slow.add(plane()) - 8.0).ravel(), (slow.add(plane()) - 8.0).ravel()
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(0.9, abs=0.05)
    first, second = (fresh.add(plane()) - 8.0).ravel(), (fresh.add(plane()) - 8.0).ravel()
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.3


def test_what_the_right_camera_cannot_see_is_lost_left_of_near_objects():
    seen = errors().add(step())
    assert (seen[:, 93:100] == 0.0).all(), "12 - 4 = 8 px of background are hidden"
    np.testing.assert_array_equal(seen[:, :92], step()[:, :92])
    np.testing.assert_array_equal(seen[:, 100:], step()[:, 100:])


def test_near_objects_are_fattened_by_a_window():
    shape = (256, 512)
    disparity = np.full(shape, 4.0, np.float32)
    disparity[:, 200:300] = 12.0
    grown = errors(fattened=0.999999).add(disparity)
    assert (grown[:, 300:302] == 12.0).mean() > 0.99
    assert (grown[:, 303:] == 4.0).all()


def test_dropouts_are_patches_of_the_share_asked_for():
    lost = np.array([errors(seed, dropout=0.1, far_dropout=0.1).add(plane()) == 0.0 for seed in range(12)])
    assert lost.mean() == pytest.approx(0.1, abs=0.03)
    inside = lost[:, 1:-1, 1:-1] & lost[:, 2:, 1:-1] & lost[:, :-2, 1:-1]
    assert inside.sum() > 0.4 * lost.sum()


def test_some_of_the_sky_gets_a_small_wrong_disparity():
    sky = errors(sky=0.2).add(plane(0.0))
    assert 0.05 < (sky > 0.0).mean() < 0.4
    assert sky.max() < 4.0


def test_label_errors_stay_near_borders_but_for_patches():
    label = np.full(SHAPE, 7, np.uint8)
    label[:, 128:] = 11
    noise = LabelNoise(warp_px=0.35, bad_borders=0.0, confused=0.0, mistaken=0.0)
    scaled = np.array([LabelErrors(noise, np.random.default_rng(seed)).add(label) for seed in range(8)])
    wrong = (scaled != label).any(axis=(0, 1))
    assert wrong.any()
    assert set(np.flatnonzero(wrong)) <= set(range(126, 130))
    np.testing.assert_array_equal(np.unique(scaled), [7, 11])


def test_confusion_reaches_farther_than_border_errors():
    label = np.full((256, 512), 7, np.uint8)
    label[:, 256:] = 11
    near = LabelErrors(LabelNoise(confused=0.0, bad_borders=0.0, mistaken=0.0), np.random.default_rng(1))
    far = LabelErrors(LabelNoise(confused=0.3, bad_borders=0.0, mistaken=0.0), np.random.default_rng(1))

    def reach(found):
        return np.abs(np.flatnonzero((found.add(label) != label).any(axis=0)) - 256).max()

    assert reach(far) > 3 * reach(near)


def test_label_errors_flicker_but_are_carried_in_part():
    label = (np.indices(SHAPE).sum(axis=0) // 8 % 2).astype(np.uint8)

    def overlap(persistence):
        errors = LabelErrors(LabelNoise(warp_px=1.0, mistaken=0.0, persistence=persistence), np.random.default_rng(2))
        first, second = errors.add(label) != label, errors.add(label) != label
        return (first & second).sum() / (first | second).sum()

    assert overlap(0.9) > 1.5 * overlap(0.0)


def test_dropouts_are_more_frequent_far_away():
    disparity = np.full(SHAPE, 1.0, np.float32)
    disparity[64:] = 30.0
    lost = np.array([errors(seed, dropout=0.02, far_dropout=0.3).add(disparity) == 0.0 for seed in range(8)])
    assert lost[:, :64, 32:].mean() > 3 * lost[:, 64:, 32:].mean() > 0.0


def test_mismatches_are_patches_that_stay_for_a_while():
    noisy = errors(mismatched=0.05, mismatch_px=20.0)
    first, second = (noisy.add(plane()) != 8.0 for _ in range(2))
    assert 0.01 < first.mean() < 0.12
    assert (first & second).sum() > 0.4 * first.sum()


def test_mistakes_give_a_label_only_those_that_it_is_taken_for():
    building, vegetation, wall, sky = (LABEL_ID[name] for name in ("building", "vegetation", "wall", "sky"))
    label = np.full((256, 512), building, np.uint8)
    label[:64] = sky
    quiet = {"warp_px": 0.0, "bad_borders": 0.0, "confused": 0.0}
    found = np.array([LabelErrors(LabelNoise(**quiet), np.random.default_rng(s)).add(label) for s in range(8)])
    assert set(np.unique(found)) == {building, vegetation, wall, sky}
    assert (found[:, :64] == sky).all()
    assert 0.01 < (found[:, 64:] != building).mean() < 0.06
