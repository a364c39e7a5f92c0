"""A log read by the reference implementation for JavaScript, which knows nothing of this package."""

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest
from support.cityscapes_tree import Tree
from support.driving import driving

from semgrid_eval.frames.cityscapes import find_sequences
from semgrid_eval.log.store import write_log

PACKAGES = ("@mcap/core@2.2.2", "@mcap/support@1.1.0")
SCRIPT = Path(__file__).with_name("independent_reader") / "read.mjs"


@pytest.fixture(scope="module")
def script():
    """The script beside its installed packages, kept between runs."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are needed to read a log with the reference implementation for JavaScript")
    version = hashlib.sha256(" ".join(PACKAGES).encode() + SCRIPT.read_bytes()).hexdigest()[:12]
    folder = Path(tempfile.gettempdir()) / f"semgrid-eval-reader-{os.getuid()}-{version}"
    if not folder.is_dir():
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            fresh = Path(scratch) / "reader"
            install(fresh)
            with suppress(OSError):  # another process of the same suite was faster
                fresh.rename(folder)
    return folder / SCRIPT.name


def install(folder):
    folder.mkdir()
    shutil.copy(SCRIPT, folder)
    quiet = ("--no-audit", "--no-fund", "--ignore-scripts", "--fetch-retries=0")
    try:
        command = ["npm", "install", "--prefix", str(folder), *quiet, *PACKAGES]
        subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    except subprocess.SubprocessError as error:
        reason = str(getattr(error, "stderr", None) or error).splitlines()[0]
        pytest.skip(f"npm cannot install {' and '.join(PACKAGES)} here: {reason}")


def read(script, path):
    done = subprocess.run(["node", str(script), str(path)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def of_topic(found, topic):
    return [message for message in found["messages"] if message["topic"] == topic]


def test_log_of_a_cityscapes_tree_is_read_whole(script, tmp_path):
    tree = Tree(tmp_path / "src", gt_fine=True)
    names = tree.write(range(30))
    (sequence,) = find_sequences(tree.root)
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
