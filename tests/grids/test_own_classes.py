"""Grids of other classes than the default ones, against small computations that share nothing with the package's."""

from collections import Counter

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support.own_classes import FILE, class_set, merged
from support.toy_world import street

from semgrid_eval.classes import DEFAULT_CLASSES, NO_POINT, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.files import digest_value
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.build import build_log, grid_key
from semgrid_eval.grids.rasterise import grid_of
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.store import write_log
from semgrid_eval.sensors.sensor import Points

OWN = parse_config(ClassSet, yaml.safe_load(FILE))
SPEC = GridSpec(rows=12, columns=12, cell_m=2.0, agent_row=12, agent_column=6)
STATIC = ("road", "sidewalk", "building", "vegetation")
VEHICLES, SMALL = ("car", "large_vehicle"), ("person", "bicycle")


def labelled_points(seed, count=900):
    """Points on the grid and around it with random labels: forward, left, label id."""
    rng = np.random.default_rng(seed)
    labels = rng.choice([*LABEL_ID.values(), 40], count)
    return rng.uniform(-1.0, 25.0, count), rng.uniform(-13.0, 13.0, count), labels.astype(np.uint8)


def grid_with(classes, seed, **changes):
    config = GridConfig(spec=SPEC, classes=classes, **{"morphology": "off", **changes})
    forward_m, left_m, labels = labelled_points(seed)
    points = Points("full", 0, forward_m, left_m, config.class_by_label()[labels])
    return grid_of([(points, SE2(0.0, 0.0, 0.0))], config)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(), (1,), (2,), (1, 3), (1, 2, 3)]))
def test_merging_whole_priorities_is_the_default_grid_merged(seed, cuts):
    """The class of the highest priority wins by that alone, so what is merged within and next to it changes nothing."""
    levels, groups = [STATIC, ("pole_sign",), VEHICLES, SMALL], []
    for first, last in zip((0, *cuts), (*cuts, 4), strict=True):
        groups.append(tuple(name for level in levels[first:last] for name in level))
    classes, places = merged(*groups)
    np.testing.assert_array_equal(grid_with(classes, seed), np.array(places)[grid_with(DEFAULT_CLASSES, seed)])


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_leaving_the_highest_priority_out_changes_no_other_cell(seed):
    classes, places = merged(STATIC, ("pole_sign",), VEHICLES)
    whole, part = grid_with(DEFAULT_CLASSES, seed), grid_with(classes, seed)
    there = ~np.isin(whole, [DEFAULT_CLASSES.names.index(name) for name in SMALL])
    np.testing.assert_array_equal(part[there], np.array(places)[whole[there]])


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_five_own_classes_are_decided_as_the_page_says(seed):
    listed = yaml.safe_load(FILE)
    order = [category["name"] for category in listed["categories"]]
    owner = {label: i for i, each in enumerate(listed["classes"]) for label in each.get("labels", ())}
    by_id = {LABEL_ID.get(label, label): i for label, i in owner.items()}
    cells: dict[tuple[int, int], Counter[int]] = {}
    for forward_m, left_m, label in zip(*(each.tolist() for each in labelled_points(seed)), strict=True):
        cell = int(11 - forward_m // 2.0), int(5 - left_m // 2.0)
        if label in by_id and max(cell) < 12 and min(cell) >= 0:
            cells.setdefault(cell, Counter())[by_id[label]] += 1
    expected = np.zeros((12, 12), np.uint8)
    for cell, counts in cells.items():
        expected[cell] = max(counts, key=lambda i: (order.index(listed["classes"][i]["category"]), counts[i], -i))
    np.testing.assert_array_equal(grid_with(OWN, seed), expected)
    assert len(np.unique(expected)) > 3


def two(first, second, **of_second):
    categories = [{"name": "ground"}, {"name": "object"}]
    return class_set(
        {"name": "a", "category": "ground", "labels": [first]},
        {"name": "b", "category": "object", "labels": [second], **of_second},
        categories=categories,
    )


def cell_with(classes, labels):
    table = GridConfig(classes=classes).class_by_label()
    ids = table[[LABEL_ID[label] for label in labels]]
    points = Points("full", 0, np.full(len(ids), 1.0), np.full(len(ids), 1.0), ids)
    return grid_of([(points, SE2(0.0, 0.0, 0.0))], GridConfig(spec=SPEC, classes=classes, morphology="off"))[11, 5]


def test_a_priority_of_its_own_overrules_that_of_the_category():
    assert cell_with(two("road", "car"), ["road", "road", "car"]) == 2
    assert cell_with(two("road", "car", priority=1), ["road", "road", "car"]) == 1, "of equals more points win"
    assert cell_with(two("road", "car", priority=1), ["road", "car"]) == 1, "then the lower id"


def test_kernels_belong_to_the_category():
    labels = {"name": "a", "category": "ground", "labels": ["road"]}
    plain, wide = (
        class_set(labels, categories=[{"name": "ground", "kernels_cells": sides}])
        for sides in ([1, 1, 1, 1], [3, 2, 4, 4])
    )
    for seed in range(5):
        unfiltered = grid_with(plain, seed)
        np.testing.assert_array_equal(grid_with(plain, seed, morphology="minkowski"), unfiltered)
        assert (grid_with(wide, seed, morphology="minkowski") != unfiltered).any()


def test_a_log_gives_the_default_grids_merged(tmp_path):
    write_log(street(3, frames=4, noise_px=0.05).recording(), tmp_path / "toy.mcap")
    classes, places = merged((*STATIC, "pole_sign"), (*VEHICLES, *SMALL))
    own, usual = (
        build_log(tmp_path / "toy.mcap", GridConfig(classes=each, morphology="off"))[0].grids
        for each in (classes, DEFAULT_CLASSES)
    )
    assert set(np.unique(own)) == {0, 1, 2}
    np.testing.assert_array_equal(own, np.array(places)[usual])


def test_the_default_set_is_not_written_and_another_one_is_part_of_the_digest():
    config = GridConfig()
    assert "classes" not in config.model_dump(mode="json")
    assert digest_value(config.model_dump(mode="json")) == "961a43ac9b56180b", "grids of earlier versions are found"
    own = GridConfig(classes=OWN)
    assert parse_config(GridConfig, own.model_dump(mode="json")) == own
    assert len({grid_key("a", each) for each in (config, own, GridConfig(classes=two("road", "car")))}) == 3


def test_labels_without_a_class_give_no_point():
    table = GridConfig(classes=OWN, class_map={"sky": "fixed", "car": None}).class_by_label()
    assert table[LABEL_ID["sky"]] == OWN.names.index("fixed")
    assert table[LABEL_ID["car"]] == table[LABEL_ID["static"]] == NO_POINT
    assert table[40] == OWN.names.index("vehicle")


def test_replacements_name_classes_of_the_set():
    with pytest.raises(ValueError, match="'road' is not one of unknown, drivable"):
        GridConfig(classes=OWN, class_map={"car": "road"})
