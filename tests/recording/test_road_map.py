import pytest

from semgrid_eval.recording.road_map import RoadMap

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.5))


def test_a_map_comes_back():
    given = RoadMap((SQUARE, SQUARE), (SQUARE[::-1],))
    assert RoadMap.from_json(given.to_json()) == given


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[]", "a map has the keys drivable and crossings"),
        ('{"drivable": []}', "a map has the keys drivable and crossings"),
        ('{"drivable": 3, "crossings": []}', "3 in a map is not a list"),
        ('{"drivable": [[[0, 1], [2, 3]]], "crossings": []}', "a polygon of a map has 2 corners"),
        ('{"drivable": [[[0, 1], [2, 3], [NaN, 4]]], "crossings": []}', r"a corner of a map is at \[nan, 4\]"),
        ('{"drivable": [[[0, 1], [2, 3], ["a", 4]]], "crossings": []}', r"a corner of a map is at \['a', 4\]"),
        ('{"drivable": [[[0, 1], [2, 3], [1e9, 4]]], "crossings": []}', r"a corner of a map is at \[1000000000.0, 4\]"),
        ('{"drivable": [[[0, 1], [2, 3], [4]]], "crossings": []}', "not enough values.*"),
        ("{", ".*"),
    ],
)
def test_what_is_not_a_map_is_refused(text, line):
    with pytest.raises(ValueError, match=f"^{line}$"):
        RoadMap.from_json(text.encode())


def test_a_map_has_a_bound(monkeypatch):
    monkeypatch.setattr("semgrid_eval.recording.road_map.MAX_CORNERS", 5)
    with pytest.raises(ValueError, match=r"^a map has more than 5 corners$"):
        RoadMap.from_json(RoadMap((SQUARE,), (SQUARE,)).to_json())
