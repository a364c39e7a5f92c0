"""The frozen benchmarks: their definitions, and how recordings are compared with the published ones."""

import pytest

from semgrid_eval.sources.benchmarks import (
    BENCHMARKS,
    SIZES,
    BenchmarkSize,
    SplitSize,
    benchmark_digest,
    compare,
    load_benchmark,
    published_fingerprints,
)
from semgrid_eval.sources.town.kinds import KINDS

FOUND = {"val/b": "0123456789abcdef", "train/a": "fedcba9876543210"}
OTHER = {**FOUND, "val/b": "1123456789abcdef"}


def size(fingerprints):
    split = SplitSize(recordings=1, towns=1)
    return BenchmarkSize(seed=1, train=split, val=split, fingerprints=fingerprints, versions={})


def published(found):
    return size(" ".join(found[label][:8] for label in sorted(found)))


def test_sizes_are_those_of_the_paper_s_data_and_of_a_desktop():
    sizes = load_benchmark("town-v1").sizes
    counts = {name: (sizes[name].train.recordings, sizes[name].val.recordings) for name in SIZES}
    assert counts == {"small": (300, 120), "full": (2975, 500)}


def test_the_benchmark_of_rigs_has_all_sensors_and_the_towns_of_town_v1_in_the_same_splits():
    plain, rigged = (load_benchmark(name) for name in BENCHMARKS)
    assert (plain.rig, rigged.rig) == ("front", "surround+lidar")
    assert (plain.town_size_m, plain.duration_s) == (rigged.town_size_m, rigged.duration_s)
    one, other = plain.sizes["small"], rigged.sizes["small"]
    assert (one.seed, one.train.towns, one.val.towns) == (other.seed, other.train.towns, other.val.towns)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_split_of_every_size_has_all_kinds_of_town_equally_often(name):
    for chosen in load_benchmark(name).sizes.values():
        assert chosen.train.towns % len(KINDS) == 0
        assert chosen.val.towns % len(KINDS) == 0


@pytest.mark.parametrize("name", BENCHMARKS)
def test_no_size_trains_in_a_town_of_another(name):
    sizes = load_benchmark(name).sizes
    assert len({chosen.seed for chosen in sizes.values()}) == len(sizes)


def test_equal_recordings_have_the_published_digest():
    found = compare(published(FOUND), FOUND)
    assert found.digest == found.published == benchmark_digest(FOUND)
    assert found.differing == ()


def test_recordings_that_differ_are_named():
    found = compare(published(FOUND), OTHER)
    assert found.differing == ("val/b",)
    assert found.digest != found.published == benchmark_digest(FOUND)


def test_the_digest_knows_names_but_not_their_order():
    assert benchmark_digest(dict(reversed(FOUND.items()))) == benchmark_digest(FOUND)
    assert benchmark_digest({"val/c": FOUND["val/b"], "train/a": FOUND["train/a"]}) != benchmark_digest(FOUND)


def test_before_anything_is_published_there_is_nothing_to_differ_from():
    found = compare(size(None), FOUND)
    assert (found.published, found.differing) == (None, ())


@pytest.mark.parametrize(
    ("dataset", "count"), [("town-v1/small", 420), ("town-v1/full", 3475), ("town-rig-v1/small", 100), ("synthetic", 0)]
)
def test_every_recording_of_a_benchmark_is_published_with_a_fingerprint_of_its_own(dataset, count):
    assert len(published_fingerprints(dataset)) == count
