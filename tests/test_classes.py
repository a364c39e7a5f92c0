import numpy as np
import pytest
import yaml
from support.own_classes import FILE, class_set

from semgrid_eval.class_files import default_classes_text, with_classes
from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES, NO_POINT, UNKNOWN, ClassSet, load_classes
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.labels import CITYSCAPES_LABELS, label_ids_from_train_ids
from semgrid_eval.scores.metrics.iou import Iou

OWN = parse_config(ClassSet, yaml.safe_load(FILE))


def grid_class(label_name):
    label = next(label for label in CITYSCAPES_LABELS if label.name == label_name)
    value = DEFAULT_CLASSES.class_by_label()[label.label_id]
    return None if value == NO_POINT else CLASS_NAMES[value]


def test_class_map_follows_reading_21():
    expected = {
        "building": "wall fence bridge tunnel building",
        "vegetation": "terrain vegetation",
        "person": "rider person",
        "bicycle": "motorcycle bicycle",
        "large_vehicle": "truck bus train caravan trailer",
        "pole_sign": "pole polegroup",
        "road": "ground parking road",
    }
    for name, labels in expected.items():
        assert [grid_class(label) for label in labels.split()] == [name] * len(labels.split())
    assert grid_class("guard rail") == "building"
    assert grid_class("rail track") == "road"
    assert grid_class("traffic sign") == grid_class("traffic light") == "pole_sign"
    assert grid_class("sky") is grid_class("ego vehicle") is grid_class("static") is None


def test_ids_that_cityscapes_does_not_know_give_no_point():
    assert set(DEFAULT_CLASSES.class_by_label()[34:]) == {NO_POINT}
    assert UNKNOWN not in DEFAULT_CLASSES.class_by_label()


def test_train_ids_are_the_nineteen_of_cityscapes_in_order():
    names = {label.label_id: label.name for label in CITYSCAPES_LABELS}
    table = label_ids_from_train_ids()
    expected = (
        "road,sidewalk,building,wall,fence,pole,traffic light,traffic sign,vegetation,terrain,sky,person,rider,car,"
        "truck,bus,train,motorcycle,bicycle"
    )
    assert ",".join(names[table[i]] for i in range(19)) == expected
    assert set(table[19:]) == {0}


def test_priority_ascends_static_small_static_vehicles_small_dynamic():
    value = dict(zip(CLASS_NAMES, DEFAULT_CLASSES.priorities(), strict=True))
    assert value["unknown"] < value["road"] == value["building"] < value["pole_sign"]
    assert value["pole_sign"] < value["car"] == value["large_vehicle"] < value["person"] == value["bicycle"]


def test_every_class_is_in_one_category():
    members = [i for name in DEFAULT_CLASSES.category_names for i in DEFAULT_CLASSES.members(name)]
    assert sorted(members) == list(range(len(CLASS_NAMES)))


def test_known_classes_are_all_but_unknown():
    assert [CLASS_NAMES[i] for i in DEFAULT_CLASSES.known] == [name for name in CLASS_NAMES if name != "unknown"]


def test_the_printed_file_is_the_default_set(tmp_path):
    (tmp_path / "classes.yaml").write_text(default_classes_text())
    assert load_classes(tmp_path / "classes.yaml") == DEFAULT_CLASSES
    assert parse_config(ClassSet, DEFAULT_CLASSES.model_dump(mode="json")) == DEFAULT_CLASSES


def test_a_set_carries_all_that_is_asked_of_classes():
    assert OWN.names == ("unknown", "drivable", "walkable", "fixed", "vehicle", "pedestrian")
    assert OWN.priorities().tolist() == [0, 1, 1, 2, 3, 4]
    assert (OWN.known, OWN.background, OWN.movable, OWN.fast) == ((1, 2, 3, 4, 5), (1, 2), (4, 5), (4,))
    assert dict(OWN.averaged) == {
        "surface": (1, 2), "obstacle": (3,), "traffic": (4,), "people": (5,), "mean_known": (1, 2, 3, 4, 5)
    }  # fmt: skip
    assert OWN.kernels_cells(2) == (3, 2, 4, 4)
    assert OWN.kernels_cells(4) == (1, 1, 2, 2)
    assert OWN.palette()[1].tolist() == [90, 90, 160]
    assert OWN.palette(safe=True)[1].tolist() == [28, 51, 83]
    assert OWN.palette(safe=True)[0].tolist() == [0, 0, 0], "what is not given is the colour"


def test_unknown_moves_nowhere_whatever_its_category_does():
    entry = {"category": "all", "colour": [0, 0, 0]}
    listed = [{"name": "unknown", **entry}, {"name": "merged_lane", "labels": ["road"], **entry}]
    still = parse_config(ClassSet, {"categories": [{"name": "all", "moves": "slow"}], "classes": listed})
    assert (still.movable, still.fast, still.background) == ((1,), (), (1,))
    iou = Iou(still)
    assert iou.moving == ("merged_lane",)
    assert list(iou.labels) == [
        "unknown", "merged_lane", "all", "all_known", "mean_known", "merged_all", "merged_all_known"
    ]  # fmt: skip
    assert iou.cells(np.array([[3, 1], [2, 5]])).tolist() == [4, 7, 11, 7, 7, 11, 7]


def test_unknown_in_a_category_gives_it_two_means():
    assert dict(DEFAULT_CLASSES.averaged)["static"] == (0, 1, 2, 3, 4)
    assert dict(DEFAULT_CLASSES.averaged)["static_known"] == (1, 2, 3, 4)
    assert "surface_known" not in OWN.averaged


def test_sets_that_differ_in_anything_are_different_and_equal_ones_are_one():
    same, other = (
        class_set({"name": "a", "category": "c", "labels": [label]}, categories=[{"name": "c"}])
        for label in ("road", "car")
    )
    assert len({OWN, parse_config(ClassSet, yaml.safe_load(FILE)), same, other}) == 3


def test_64_classes_are_drawn_in_as_many_colours():
    many = class_set(
        *({"name": f"c{i}", "category": "c", "labels": [100 + i], "colour": [i, 0, 0]} for i in range(63)),
        categories=[{"name": "c"}],
    )
    assert many.count == 64
    assert len(np.unique(many.palette(), axis=0)) == 63, "the first one is as black as unknown"
    assert many.class_by_label()[162] == 63


def test_a_path_is_relative_to_the_file_that_names_it(tmp_path):
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets" / "mine.yaml").write_text(FILE)
    beside = tmp_path / "m.yaml"
    found = with_classes({"classes": "sets/mine.yaml", "stretch_frames": 9}, beside, "grid.classes")
    assert found == {"classes": OWN.model_dump(mode="json"), "stretch_frames": 9}
    assert with_classes({"stretch_frames": 9}, beside, "grid.classes") == {"stretch_frames": 9}
    with pytest.raises(ConfigError, match=r"m\.yaml: row 'a': .*/sets/other\.yaml: cannot be read: No such file"):
        with_classes({"classes": "sets/other.yaml"}, beside, "row 'a'")
