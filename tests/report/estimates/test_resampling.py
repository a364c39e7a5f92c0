"""Weights of recordings: by recordings, and by groups against a twin that copies recordings out."""

import numpy as np
import pytest

from semgrid_eval.report.estimates.bootstrap import Resampling, group_weights, recording_weights

GROUPS = ["a"] * 5 + ["b"] * 2 + ["c"] * 3 + ["d"]


def slow_group_weights(groups, generator, draws):
    """Draw whole groups, then recordings within each that was drawn, one by one."""
    names = sorted(set(groups))
    weights = np.zeros((draws, len(groups)), int)
    for line in weights:
        for drawn in generator.integers(0, len(names), len(names)):
            members = [i for i, group in enumerate(groups) if group == names[drawn]]
            for place in generator.integers(0, len(members), len(members)):
                line[members[place]] += 1
    return weights


def test_each_resample_has_as_many_recordings_as_there_are():
    weights = recording_weights(7, np.random.default_rng(1), draws=50)
    assert weights.shape == (50, 7)
    assert (weights.sum(axis=1) == 7).all()


def test_groups_count_as_often_as_they_are_drawn():
    weights = group_weights(GROUPS, np.random.default_rng(1), draws=200)
    for name, size in (("a", 5), ("b", 2), ("c", 3), ("d", 1)):
        mine = weights[:, [group == name for group in GROUPS]].sum(axis=1)
        assert (mine % size == 0).all()  # whole groups
        assert mine.max() > size
    sizes = np.array([GROUPS.count(group) for group in GROUPS])
    assert ((weights / sizes).sum(axis=1).round(9) == 4).all()  # four groups in each resample


def test_two_levels_are_drawn_like_recordings_copied_out():
    """Mean and spread of a score, and its interval, are those of the twin; both have 20,000 draws."""
    scores = np.linspace(0, 1, len(GROUPS)) ** 2
    fast = group_weights(GROUPS, np.random.default_rng(2), draws=20_000)
    slow = slow_group_weights(GROUPS, np.random.default_rng(3), 20_000)
    np.testing.assert_allclose(fast.mean(axis=0), slow.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.cov(fast.T), np.cov(slow.T), atol=0.12)
    ends = [np.quantile(weights @ scores / weights.sum(axis=1), [0.025, 0.5, 0.975]) for weights in (fast, slow)]
    np.testing.assert_allclose(*ends, atol=0.01)


def test_groups_of_one_are_drawn_like_recordings():
    groups = [f"r{i}" for i in range(6)]
    alone = group_weights(groups, np.random.default_rng(5), draws=30)
    np.testing.assert_array_equal(alone, recording_weights(6, np.random.default_rng(5), draws=30))


def test_one_group_gives_no_draws():
    assert Resampling(level="groups").draw(["a", "a", "a"], [1]).weights.shape == (0, 3)


def test_dependent_recordings_give_wider_intervals_by_groups():
    groups, scores = np.repeat(["a", "b", "c", "d", "e"], 8).tolist(), np.repeat([0.1, 0.3, 0.5, 0.7, 0.9], 8)
    widths = []
    for level in ("recordings", "groups"):
        weights = Resampling(0, level=level).draw(groups, [1]).weights
        widths.append(np.ptp(np.quantile(weights @ scores / weights.sum(axis=1), [0.025, 0.975])))
    assert widths[1] > 2 * widths[0]


@pytest.mark.parametrize(("level", "word"), [("recordings", "independent"), ("groups", "may depend on each other")])
def test_it_says_what_it_resamples_and_why(level, word):
    assert word in Resampling(level=level).sentence
