import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.metrics import confusion_matrix, jaccard_score

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, DEFAULT_CLASSES, UNKNOWN
from semgrid_eval.scores.metrics.iou import class_iou, confusion
from semgrid_eval.scores.metrics.metric import mean_finite
from semgrid_eval.scores.metrics.table import IOU

MEMBERS = {name: DEFAULT_CLASSES.members(name) for name in DEFAULT_CLASSES.category_names}


def random_grids(seed, shape=(3, 7, 9), classes=CLASS_COUNT):
    rng = np.random.default_rng(seed)
    target, prediction = rng.integers(0, classes, (2, *shape), dtype=np.uint8)
    return target, prediction, rng.random(shape) < 0.3


def figures(counts):
    return dict(zip([column.name for column in IOU.columns], IOU.figures(IOU.ratios(counts)), strict=True))


def slow_iou(target, prediction, mask, class_id):
    intersection = union = 0
    for t, p, m in zip(target.ravel(), prediction.ravel(), mask.ravel(), strict=True):
        if not m:
            intersection += t == class_id and p == class_id
            union += t == class_id or p == class_id
    return intersection / union if union else float("nan")


@given(st.integers(0, 2**32 - 1), st.integers(2, CLASS_COUNT))
def test_pooled_class_iou_matches_a_cell_by_cell_twin(seed, classes):
    target, prediction, mask = random_grids(seed, classes=classes)
    iou = class_iou(confusion(target, prediction, mask, CLASS_COUNT).sum(axis=0))
    slow = [slow_iou(target, prediction, mask, c) for c in range(CLASS_COUNT)]
    np.testing.assert_allclose(iou, slow, equal_nan=True)


def test_counts_and_iou_match_scikit_learn():
    target, prediction, mask = random_grids(1)
    counts = confusion(target, prediction, mask, CLASS_COUNT)
    labels = list(range(CLASS_COUNT))
    for n in range(len(target)):
        expected = confusion_matrix(target[n][~mask[n]], prediction[n][~mask[n]], labels=labels)
        np.testing.assert_array_equal(counts[n], expected)
    expected = jaccard_score(target[~mask], prediction[~mask], labels=labels, average=None)
    np.testing.assert_allclose(class_iou(counts.sum(axis=0)), expected)


def test_rows_are_targets_and_columns_are_predictions():
    target, prediction = np.full((1, 2, 2), 3, np.uint8), np.full((1, 2, 2), 6, np.uint8)
    mask = np.array([[[True, False], [False, False]]])
    counts = confusion(target, prediction, mask, CLASS_COUNT)
    assert counts[0, 3, 6] == 3
    assert counts.sum() == 3


def test_a_class_in_neither_grid_is_nan_and_in_one_only_is_zero():
    target, prediction = np.zeros((1, 2, 2), np.uint8), np.zeros((1, 2, 2), np.uint8)
    prediction[0, 0, 0] = 4
    iou = class_iou(confusion(target, prediction, np.zeros((1, 2, 2), bool), CLASS_COUNT)[0])
    assert iou[4] == 0
    assert iou[0] == 0.75
    assert np.isnan(iou[1])


def test_category_value_is_the_mean_of_its_classes_that_are_present():
    iou = np.full(CLASS_COUNT, np.nan)
    for name, value in {"unknown": 1.0, "road": 0.8, "car": 0.5, "person": 0.4, "bicycle": 0.2}.items():
        iou[CLASS_NAMES.index(name)] = value
    categories = IOU.means(iou)
    assert categories["static"] == pytest.approx(0.9)
    assert categories["static_known"] == pytest.approx(0.8)
    assert categories["vehicles"] == pytest.approx(0.5)
    assert categories["small_dynamic"] == pytest.approx(0.3)
    assert np.isnan(categories["small_static"])
    assert categories["mean_known"] == pytest.approx((0.8 + 0.5 + 0.4 + 0.2) / 4)


def test_what_is_known_is_everything_but_unknown():
    members = DEFAULT_CLASSES.averaged
    assert [CLASS_NAMES[i] for i in members["static_known"]] == ["road", "sidewalk", "building", "vegetation"]
    assert [CLASS_NAMES[i] for i in members["mean_known"]] == list(CLASS_NAMES[1:])
    assert {name: members[name] for name in MEMBERS} == MEMBERS


def test_a_mean_leaves_out_what_is_absent_along_either_axis():
    nan = np.nan
    values = np.array([[1.0, nan, nan], [3.0, 2.0, nan]])
    np.testing.assert_array_equal(mean_finite(values), [1.0, 2.5])
    np.testing.assert_array_equal(mean_finite(values, axis=0), [2.0, 2.0, nan])


def test_merged_categories_do_not_punish_confusion_within_one():
    target, prediction, mask = random_grids(5)
    merged = figures(confusion(target, prediction, mask, CLASS_COUNT).sum(axis=0))
    category_of = np.zeros(CLASS_COUNT, np.uint8)
    for number, classes in enumerate(MEMBERS.values()):
        category_of[list(classes)] = number
    for number, name in enumerate(MEMBERS):
        slow = slow_iou(category_of[target], category_of[prediction], mask, number)
        assert merged[f"merged_{name}"] == pytest.approx(slow)


def test_shapes_that_differ_are_refused():
    with pytest.raises(ValueError, match="shapes differ"):
        confusion(np.zeros((1, 2, 2), np.uint8), np.zeros((1, 2, 3), np.uint8), np.zeros((1, 2, 2), bool), CLASS_COUNT)


COUNTS = arrays(np.int64, (CLASS_COUNT, CLASS_COUNT), elements=st.integers(0, 50))


def slow_of_counts(counts, ids):
    hits = sum(int(counts[i, j]) for i in ids for j in ids)
    inside = sum(int(counts[i, j]) for i in range(CLASS_COUNT) for j in range(CLASS_COUNT) if i in ids or j in ids)
    return hits / inside if inside else float("nan")


@given(COUNTS)
def test_figures_are_class_ious_means_of_categories_and_merged_categories(counts):
    got = figures(counts)
    classes = [slow_of_counts(counts, {i}) for i in range(CLASS_COUNT)]
    known = [v for i, v in enumerate(classes) if i != UNKNOWN and v == v]
    np.testing.assert_allclose([got[name] for name in CLASS_NAMES], classes)
    np.testing.assert_allclose(got["mean_known"], np.mean(known) if known else np.nan)
    for name, ids in MEMBERS.items():
        present = [classes[i] for i in ids if classes[i] == classes[i]]
        np.testing.assert_allclose(got[name], np.mean(present) if present else np.nan)
        np.testing.assert_allclose(got[f"merged_{name}"], slow_of_counts(counts, set(ids)))
    static = set(MEMBERS["static"]) - {UNKNOWN}
    np.testing.assert_allclose(got["merged_static_known"], slow_of_counts(counts, static))


@given(arrays(np.int64, (3, CLASS_COUNT, CLASS_COUNT), elements=st.integers(0, 50)))
def test_ratios_can_be_summed_like_counts(counts):
    np.testing.assert_array_equal(IOU.ratios(counts).sum(axis=0), IOU.ratios(counts.sum(axis=0)))


def test_cells_are_those_of_the_target_outside_the_mask():
    target, prediction, mask = random_grids(3)
    counts = confusion(target, prediction, mask, CLASS_COUNT).sum(axis=0)
    got = dict(zip([column.name for column in IOU.columns], IOU.cells(counts).tolist(), strict=True))
    for index, name in enumerate(CLASS_NAMES):
        assert got[name] == np.sum((target == index) & ~mask)
    assert got["vehicles"] == got["merged_vehicles"] == got["car"] + got["large_vehicle"]
    assert got["mean_known"] == np.sum(~mask) - got["unknown"]
