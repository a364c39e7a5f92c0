"""A log read by the reference implementation for JavaScript, which knows nothing of this package."""

import json
from collections import Counter

import pytest
from support.cityscapes_tree import Tree, only
from support.driving import driving
from support.independent_reader import of_topic, read, reader_script, sha256

from semgrid_eval.log.store import write_log


@pytest.fixture(scope="module")
def script():
    return reader_script()


def test_log_of_a_cityscapes_tree_is_read_whole(script, tmp_path):
    tree = Tree(tmp_path / "src", gt_fine=True)
    names = tree.write(range(30))
    sequence = only(tree)
    write_log(sequence.recording(), tmp_path / "log.mcap")
    found = read(script, tmp_path / "log.mcap")
    assert found["done"]
    assert Counter(message["topic"] for message in found["messages"]) == {
        **dict.fromkeys(("/tf", "/ego/pose", "/ego/motion"), 30),
        **{f"/camera/front/{name}": 30 for name in ("image", "disparity", "calibration", "stereo")},
        "/camera/front/label": 1,
    }
    images = [message["value"]["data"] for message in of_topic(found, "/camera/front/image")]
    assert images == [sha256(tree.image(name).read_bytes()) for name in names]
    motion = of_topic(found, "/ego/motion")[3]
    expected = json.loads(tree.vehicle(names[3]).read_bytes())
    assert motion["schema"] == "semgrid.v1.Egomotion"
    assert motion["value"]["speed_mps"] == expected["speed"]
    assert motion["value"]["heading_deg"] == expected["gpsHeading"]
    assert motion["log_ns"] == tree.timestamp(names[3]).read_text()
    assert found["attachments"] == {"front_camera.json": sha256(tree.camera(names[0]).read_bytes())}
    assert found["metadata"]["semgrid.scene"]["name"] == names[0]


def test_log_with_truth_is_read_whole(script, tmp_path):
    write_log(driving(cameras=("front", "rear")), tmp_path / "log.mcap")
    found = read(script, tmp_path / "log.mcap")
    assert found["done"]
    schemas = {message["topic"]: message["schema"] for message in found["messages"]}
    assert schemas["/truth/actors"] == "semgrid.v1.Actors"
    assert schemas["/camera/rear/stereo"] == "semgrid.v1.StereoCalibration"
    moments = list(driving(cameras=("front", "rear")).moments())
    for message, moment in zip(of_topic(found, "/truth/actors"), moments, strict=True):
        boxes = message["value"].get("actors", [])
        assert [box["actor_id"] for box in boxes] == [actor.actor_id for actor in moment.actors]
        assert [box["y_m"] for box in boxes] == [actor.y_m for actor in moment.actors]
    for name, field in (("instance", "instance_png"), ("disparity", "exact_disparity_png")):
        pictures = [message["value"]["data"] for message in of_topic(found, f"/camera/rear/truth/{name}")]
        assert pictures == [sha256(getattr(moment.cameras["rear"], field)) for moment in moments]
