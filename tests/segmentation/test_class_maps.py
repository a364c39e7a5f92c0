import pytest

from semgrid_eval.errors import ConfigError
from semgrid_eval.labels import CITYSCAPES_LABELS, LABEL_ID, label_ids_from_train_ids
from semgrid_eval.segmentation.class_maps import NAMES, find_class_map, maps_of


def label_of(name, index):
    found = find_class_map(name)
    return found.classes[index], found.labels[index]


def test_cityscapes_maps_are_its_train_ids_and_its_label_ids():
    table = find_class_map("cityscapes").table()
    assert table.tolist() == label_ids_from_train_ids().tolist()
    assert find_class_map("cityscapes-ids").table()[:34].tolist() == [each.label_id for each in CITYSCAPES_LABELS]


@pytest.mark.parametrize(
    ("name", "count", "known"),
    [
        # What others have published of these orders: SceneParse150's index less 1, Vistas 1.2's place in its config.
        ("ade20k", 150, {0: "wall", 2: "sky", 6: "road", 11: "sidewalk", 12: "person", 20: "car", 83: "truck"}),
        ("ade20k", 150, {80: "bus", 93: "pole", 116: "minibike", 127: "bicycle", 136: "traffic light", 149: "flag"}),
        ("mapillary", 66, {0: "Bird", 2: "Curb", 13: "Road", 15: "Sidewalk", 19: "Person", 27: "Sky", 45: "Pole"}),
        ("mapillary", 66, {48: "Traffic Light", 52: "Bicycle", 55: "Car", 61: "Truck", 64: "Ego Vehicle"}),
    ],
)
def test_classes_are_in_the_order_of_their_data_sets(name, count, known):
    found = find_class_map(name)
    assert len(found.classes) == len(found.labels) == count
    assert {index: found.classes[index] for index in known} == known


def test_classes_of_other_data_sets_become_the_labels_that_they_are():
    assert label_of("ade20k", 102) == ("van", "car")
    assert label_of("ade20k", 2) == ("sky", "sky")
    assert label_of("ade20k", 7) == ("bed", "static")
    assert label_of("mapillary", 23) == ("Lane Marking - Crosswalk", "road")
    assert label_of("mapillary", 65) == ("Unlabeled", "unlabeled")


def test_every_class_of_every_map_has_a_label_and_what_is_no_class_is_unlabeled():
    for name in NAMES:
        found = find_class_map(name)
        table = found.table()
        assert [LABEL_ID[label] for label in found.labels] == table[: len(found.labels)].tolist()
        assert set(table[len(found.labels) :].tolist()) == {LABEL_ID["unlabeled"]}


def test_only_classes_without_label_at_the_end_may_lack():
    assert [find_class_map(name).fewest for name in NAMES] == [19, 34, 65, 150]
    assert [maps_of(count) for count in (19, 34, 64, 65, 66, 150)] == [
        ["cityscapes"],
        ["cityscapes-ids"],
        [],
        ["mapillary"],
        ["mapillary"],
        ["ade20k"],
    ]


@pytest.fixture
def own(tmp_path):
    def write(text):
        (tmp_path / "own.yaml").write_text(text)
        return find_class_map(str(tmp_path / "own.yaml"))

    return write


def test_names_are_in_the_order_of_the_outputs(own):
    found = own("classes: {street: road, wheels: car, rest: unlabeled}")
    assert (found.name, found.classes, found.labels) == (
        "own",
        ("street", "wheels", "rest"),
        ("road", "car", "unlabeled"),
    )


def test_indices_may_come_in_any_order(own):
    assert own('classes: {"1": car, "0": road}').labels == ("road", "car")


def test_base_gives_what_is_not_named(own):
    ade20k = find_class_map("ade20k")
    found = own('{base: ade20k, classes: {grass: sidewalk, "104": terrain}}')
    changed = {index for index in range(150) if found.labels[index] != ade20k.labels[index]}
    assert changed == {9, 104}
    assert (found.labels[9], found.labels[104]) == ("sidewalk", "terrain")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("classes: {street: rode, wheels: car}", "classes.street: 'rode' is not one of .*; did you mean road"),
        ("classes: {street: road}", "classes: has 1 class; 2 to 255 are possible"),
        ('classes: {"0": road, "2": car}', "classes: index 1 is missing"),
        ('classes: {"00": road, "1": car}', "classes: '00' is a name beside indices"),
        ('classes: {"0": road, wheels: car}', "classes: 'wheels' is a name beside indices"),
        ("{base: kitti, classes: {}}", "base: 'kitti' is not one of cityscapes, "),
        ("{base: ade20k, classes: {gras: road}}", "classes: ade20k: 'gras' is not one of .*; did you mean grass"),
        ('{base: cityscapes, classes: {"19": car}}', "classes: cityscapes: '19' is not one of road, "),
        ("labels: {street: road}", "labels: unknown key; allowed here: base, classes"),
    ],
)
def test_what_is_wrong_is_named(own, text, told):
    with pytest.raises(ConfigError, match=rf"own\.yaml: {told}"):
        own(text)
