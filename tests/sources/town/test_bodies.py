import numpy as np
import pytest

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.bodies import boxes_of, heights_m
from semgrid_eval.sources.town.solids import soup_of_boxes
from semgrid_eval.sources.town.traffic import ROAD_USERS, Snapshot, type_index


def one(index: int, *, yaw_rad: float = 0.0, speed_mps: float = 0.0) -> Snapshot:
    velocity = np.array([[speed_mps * np.cos(yaw_rad), speed_mps * np.sin(yaw_rad)]])
    return Snapshot(np.int32([41]), np.uint8([index]), np.array([[3.0, 4.0]]), np.array([yaw_rad]), velocity)


@pytest.mark.parametrize("index", range(len(ROAD_USERS)), ids=[user.name for user in ROAD_USERS])
def test_a_body_fills_its_box_and_not_more(index):
    user = ROAD_USERS[index]
    soup = soup_of_boxes(boxes_of(one(index, yaw_rad=np.pi / 2), 0.0))
    size = np.ptp(soup.triangles_m.reshape(-1, 3), axis=0)
    height_m = heights_m(np.int32([41]), np.uint8([index]))[0]
    assert 0.5 * user.length_m < size[1] < user.length_m + 0.15
    assert 0.9 * user.width_m < size[0] < user.width_m + 0.15
    assert size[2] == pytest.approx(height_m, abs=0.01)
    assert (soup.instance == 42).all()
    assert user.label_id in soup.label


def test_a_bicycle_carries_a_rider():
    labels = set(boxes_of(one(type_index("bicycle")), 0.0)["label"])
    assert labels == {LABEL_ID["bicycle"], LABEL_ID["rider"]}


def test_legs_swing_only_when_walking():
    person = type_index("person")
    still = [boxes_of(one(person), time_s) for time_s in (0.0, 0.3)]
    walking = [boxes_of(one(person, speed_mps=1.4), time_s) for time_s in (0.0, 0.3)]
    assert (still[0] == still[1]).all()
    assert np.abs(walking[0]["x_m"] - walking[1]["x_m"]).max() > 0.05


def test_the_same_actor_always_looks_the_same_and_others_differ():
    actors = np.arange(50, dtype=np.int32)
    kinds = np.full(50, type_index("person"), np.uint8)
    heights = heights_m(actors, kinds)
    np.testing.assert_array_equal(heights, heights_m(actors, kinds))
    assert len(np.unique(heights.round(2))) > 10
    assert 1.4 < heights.min() < heights.max() < 1.95
