"""The map that --inspect writes: names that mean something in YAML stand in quotes."""

import numpy as np
from support import ros_messages as ros
from support.bags import LATE_NS, Sent, write_bag
from support.toy_world import START_NS, street

from semgrid_eval.sources.ros2.inspection import inspect_bags
from semgrid_eval.sources.ros2.mapping import load_map

WORLD = street(1, frames=1)
ODOMETRY = ros.odometry(START_NS, next(iter(WORLD.recording().moments())).motion[0])
INFO = ros.camera_info(START_NS, size=(256, 128), k=ros.matrix(WORLD.calibration()))
IMAGE = ros.image(START_NS, np.zeros((128, 256, 3), np.uint8), "rgb8", frame="camera")
DEPTH = ros.image(START_NS, np.ones((128, 256), np.float32), "32FC1", frame="camera")


def test_topics_and_cameras_with_signs_of_yaml_are_read_as_they_are_called(tmp_path):
    sent = {"/odom,{x}": ODOMETRY}
    for number in "12":
        sent |= {f"/{number}:/info": INFO, f"/{number}:/image_rect": IMAGE, f"/{number}:/depth": DEPTH}
    write_bag(tmp_path / "drive", [Sent(topic, START_NS + LATE_NS, message) for topic, message in sent.items()])
    inspect_bags([tmp_path / "drive"], tmp_path / "map.yaml")
    text = (tmp_path / "map.yaml").read_text().replace("x_m: , y_m: , z_m: ,", "x_m: 1, y_m: 0, z_m: 2,")  # measured
    (tmp_path / "map.yaml").write_text(text)
    found = load_map(tmp_path / "map.yaml")
    assert found.motion.speed.topic == "/odom,{x}"
    assert {name: (camera.image, camera.info) for name, camera in found.cameras.items()} == {
        number: (f"/{number}:/image_rect", f"/{number}:/info") for number in "12"
    }
