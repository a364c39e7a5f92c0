import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.ros2.labels import LabelTable, likely_ids
from semgrid_eval.sources.ros2.mapping import HIGHEST_POINT


@pytest.mark.parametrize(
    ("ids", "given", "expected"),
    [
        ("label_ids", [7, 26], ["road", "car"]),
        ("train_ids", [0, 13, 255], ["road", "car", "unlabeled"]),
        ({"road": (3, 4), "person": (9,)}, [3, 4, 9], ["road", "road", "person"]),
    ],
)
def test_ids_become_label_ids(ids, given, expected):
    found = LabelTable(ids).label_ids(np.array([given], np.uint8))
    assert found.tolist() == [[LABEL_ID[name] for name in expected]]


def test_classes_of_semantickitti_become_label_ids():
    table = LabelTable("semantickitti", HIGHEST_POINT)
    assert table.label_ids(np.array([40, 252, 99], np.uint32)).tolist() == [
        LABEL_ID[name] for name in ("road", "car", "static")
    ]


@pytest.mark.parametrize(
    ("ids", "strange"),
    [("label_ids", 34), ("train_ids", 19), ({"road": (1,)}, 0), ("semantickitti", 2), ({"road": (1,)}, 70_000)],
)
def test_ids_that_are_not_named_are_refused(ids, strange):
    with pytest.raises(InputError, match=f"^ids: {strange} is a label, but not in the map$"):
        LabelTable(ids, HIGHEST_POINT).label_ids(np.array([1, strange], np.int32)[1:])


def test_negative_ids_are_refused():
    with pytest.raises(InputError, match=r"^ids: -1 is a label, but not in the map$"):
        LabelTable({"road": (1,)}).label_ids(np.array([1, -1], np.int8))


def test_the_kind_of_ids_is_guessed_by_the_highest():
    assert [likely_ids(highest) for highest in (18, 19, 33)] == ["train_ids", "label_ids", "label_ids"]
