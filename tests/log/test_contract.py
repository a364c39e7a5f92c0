import pytest

from semgrid_eval.log.contract import Cameras, Contract, Range, contract_text, load_contract, topic_beside, topics_of
from semgrid_eval.log.default_contract import default_contract
from semgrid_eval.motion import SPEED_MPS


def loaded(tmp_path, text):
    path = tmp_path / "recording.yaml"
    path.write_text(text)
    return load_contract(path)


def test_the_default_contract_comes_back_from_its_text(tmp_path):
    assert loaded(tmp_path, contract_text(default_contract())) == default_contract()


def test_the_default_limits_of_motion_are_those_of_the_conversion():
    speed = default_contract().topics["/ego/motion"].values["speed_mps"]
    assert (speed.low, speed.high) == SPEED_MPS


def test_an_empty_contract_expects_nothing(tmp_path):
    assert loaded(tmp_path, "") == loaded(tmp_path, "{}") == Contract()


@pytest.mark.parametrize(
    ("limit", "inside", "outside", "text"),
    [
        (Range(low=1), (1, 5), (0.9, float("nan")), "at least 1"),
        (Range(high=1.5), (1.5, -9), (1.6, float("inf")), "at most 1.5"),
        (Range(low=0, high=2), (0, 2), (-1, 3, float("nan")), "0 to 2"),
    ],
)
def test_a_range_holds_its_ends_and_no_nan(limit, inside, outside, text):
    assert all(map(limit.holds, inside))
    assert not any(map(limit.holds, outside))
    assert str(limit) == text


def test_a_name_with_camera_stands_for_every_camera():
    cameras = Cameras(("b",), ("a",))
    assert topics_of("/camera/{camera}/label", cameras) == {"a": "/camera/a/label", "b": "/camera/b/label"}
    assert topics_of("/camera/{stereo}/label", cameras) == {"b": "/camera/b/label"}
    assert topics_of("/camera/{single}/label", cameras) == {"a": "/camera/a/label"}
    assert topics_of("/tf", cameras) == {"": "/tf"}


@pytest.mark.parametrize("place", ["{camera}", "{stereo}", "{single}"])
def test_beside_a_camera_a_name_stands_for_its_own_topic(place):
    assert topic_beside(f"/camera/{place}/image", "a") == "/camera/a/image"
