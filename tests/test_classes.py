from semgrid_eval.classes import (
    CITYSCAPES_LABELS,
    CLASS_NAMES,
    DEFAULT_CLASSES,
    NO_POINT,
    UNKNOWN,
    label_ids_from_train_ids,
)


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
