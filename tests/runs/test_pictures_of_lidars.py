"""A run whose grids a LiDAR leads: the pictures that it keeps, its report, and its log to play."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from PIL import Image
from support.commands import run_command
from support.swept import START_NS, Drive, recorded, scanned, seen
from support.toy_world import FRAME_NS, Mount, street

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.container import Container
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.panorama import panorama
from semgrid_eval.recording.png import decode_ids
from semgrid_eval.runs.thumbnails import log_pictures
from semgrid_eval.scores.thumbnails import pictures_file, read_pictures
from semgrid_eval.sensors.lidar import LidarSensor

GRID = GridConfig(sensors={"top": LidarSensor()}, target=("top",))
MATRIX = {
    "defaults": {
        "grid": {"sensors": {"top": {"kind": "lidar"}}, "target": ["top"]},
        "sensors": ["top"],
        "window": {"step_frames": 1, "target_frame": None},
    },
    "rows": [{"name": "BL-DC", "model": "newest"}],
}
LIDAR_NS, LATE_NS = 100_000_000, 3_000_000
PLACES = [(x + 0.1 * y, y) for x in range(4, 60, 4) for y in range(-9, 9)]


def swept():
    """A LiDAR alone."""
    return scanned(Drive(), range(0, 8 * LIDAR_NS, LIDAR_NS), PLACES, label="road")


def beside_a_camera(every=1):
    """The same, and a camera that is 3 ms late, whose frames come at 17 Hz."""
    world = replace(street(1, frames=14), cameras={"rear": Mount(0.0, LATE_NS)})

    def moments():
        pictures = [moment for moment in world.recording().moments() if moment.cameras][::every]
        both = [*(replace(moment, motion=()) for moment in pictures), *swept().moments()]
        yield from sorted(both, key=lambda moment: moment.stamp_ns)

    return replace(recorded(moments), calibrations=world.recording().calibrations)


def kept(recording, folder):
    write_log(recording, folder / "log.mcap")
    with LogReader(folder / "log.mcap") as log:
        return log_pictures(folder / "log.mcap", log.digest, GRID, [START_NS, START_NS + 3 * LIDAR_NS])


def test_a_frame_has_the_nearest_pictures_of_the_camera(tmp_path):
    found = kept(beside_a_camera(), tmp_path)
    assert found.track.has_camera
    assert found.track.stamps_ns.tolist() == [START_NS + k * LIDAR_NS for k in range(8)]
    with LogReader(tmp_path / "log.mcap") as log:
        frames = {frame.stamp_ns: frame for frame in log.frames("rear", images=True)}
    nearest = {START_NS: LATE_NS, START_NS + 3 * LIDAR_NS: LATE_NS + 5 * FRAME_NS}
    assert found.frames.keys() == nearest.keys()
    for stamp_ns, after_ns in nearest.items():
        frame = frames[START_NS + after_ns]
        assert np.array_equal(decode_ids(found.frames[stamp_ns].label), decode_ids(frame.label_png))
        shown = np.asarray(Image.open(io.BytesIO(found.frames[stamp_ns].image)).convert("RGB"), int)
        assert np.abs(shown - np.asarray(Image.open(io.BytesIO(frame.image_file)).convert("RGB"), int)).mean() < 6


def test_pictures_that_are_too_far_away_are_not_taken(tmp_path):
    found = kept(beside_a_camera(every=13), tmp_path).frames
    assert found[START_NS].image
    assert not found[START_NS + 3 * LIDAR_NS].image


def test_without_a_camera_a_frame_has_what_the_lidar_saw_all_around(tmp_path):
    found = kept(swept(), tmp_path)
    assert not found.track.has_camera
    for moment in swept().moments():
        if moment.stamp_ns in found.frames:
            assert found.frames[moment.stamp_ns].image == b""
            assert np.array_equal(decode_ids(found.frames[moment.stamp_ns].label), panorama(moment.sweeps["top"]))


def test_points_without_labels_and_other_times_have_no_picture(tmp_path):
    def moments():
        for moment in swept().moments():
            sweep = seen(moment.stamp_ns, (0.0, 0.0, 0.0), PLACES)
            yield replace(moment, sweeps={"top": replace(sweep, label_id=None)})

    found = kept(recorded(moments), tmp_path)
    assert all(not each.image and not each.label for each in found.frames.values())


@pytest.fixture(scope="module", params=["camera", "lidar"])
def done(request, tmp_path_factory):
    """A run, and what its first recording has of pictures."""
    folder = tmp_path_factory.mktemp(request.param)
    recording = beside_a_camera() if request.param == "camera" else swept()
    write_log(replace(recording, name="drive"), folder / "logs" / "val" / "drive.mcap")
    (folder / "m.yaml").write_text(yaml.safe_dump(MATRIX))
    words = ["run", f"{folder}/m.yaml", "--logs", f"{folder}/logs", "--out", f"{folder}/run", "--device", "cpu"]
    ended = run_command(words)
    assert ended.code == 0, ended.err
    return folder, request.param


def test_a_run_keeps_them_and_a_report_shows_them(done):
    folder, kind = done
    with LogReader(folder / "logs/val/drive.mcap") as log:
        pictures = read_pictures(pictures_file(folder / "run", log.digest, GRID))
    assert all(bool(each.image) == (kind == "camera") for each in pictures.frames.values())
    assert all(each.label for each in pictures.frames.values())
    ended = run_command(["report", f"{folder}/run"])
    assert ended.code == 0, ended.err
    page = (folder / "run/report/index.html").read_text()
    alts = ("Camera image, at the target", "Segmentation, at the target", "Points, all around, at the target")
    assert [alt in page for alt in alts] == [kind == "camera", kind == "camera", kind == "lidar"]
    assert "no pictures of what sensors saw" not in page
    assert "play RUN BL-DC --logs LOGS --recording drive" in page


def test_it_is_played_with_its_logs(done):
    folder, kind = done
    words = ["play", f"{folder}/run", "BL-DC", "--logs", f"{folder}/logs", "--out", f"{folder}/play.mcap", "--force"]
    ended = run_command(words)
    assert ended.code == 0, ended.err
    with Container(folder / "play.mcap") as log:
        topics = {channel.topic for channel in log.summary.channels.values()}
    told = json.loads((folder / "play.layout.json").read_text())["configById"]
    shown = {panel["imageMode"]["imageTopic"] for panel in told.values() if "imageTopic" in panel["imageMode"]}
    expected = {"/camera/rear/image", "/camera/rear/label"} if kind == "camera" else {"/lidar/top/label"}
    assert shown == {*expected, "/grid/legend"}
    assert shown <= topics
