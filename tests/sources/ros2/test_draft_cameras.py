"""The map that --inspect writes of a bag of several cameras: whose pictures are whose, and that it works as it is."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from support import ros_messages as ros
from support.bags import LATE_NS, RecordingBag, Sent, Variant, write_bag
from support.commands import run_command
from support.rig_bags import Coding, RigBag, camera_link, optical
from support.swept import Drive, seen
from support.toy_world import START_NS, Mount, ToyWorld, street

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.recording.png import encode
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sources.ros2.inspection import inspect_bags
from semgrid_eval.sources.ros2.mapping import load_map

ONE = street(1, frames=1)
INFO = {"size": (256, 128), "k": ros.matrix(ONE.calibration())}


def drafted(here, messages):
    """The map that is written of a bag, as text."""
    write_bag(here / "drive", sorted(messages, key=lambda sent: sent.received_ns))
    inspect_bags([here / "drive"], here / "map.yaml")
    return (here / "map.yaml").read_text()


def cameras(text):
    """Topics by camera and use, where there is one."""
    return {
        name: {what: topic for what, topic in told.items() if isinstance(topic, str) and topic.startswith("/")}
        for name, told in yaml.safe_load(text)["cameras"].items()
    }


def sent(topic, message):
    return Sent(topic, START_NS + LATE_NS, message)


def image(topic, frame, pixels=None, coding="rgb8"):
    black = np.zeros((128, 256, 3), np.uint8) if pixels is None else pixels
    return sent(topic, ros.image(START_NS, black, coding, frame=frame))


def info(topic, **told):
    return sent(topic, ros.camera_info(START_NS, **{**INFO, **told}))


def depth(topic, frame):
    return image(topic, frame, np.ones((128, 256), np.float32), "32FC1")


def labels(topic, frame):
    return image(topic, frame, np.zeros((128, 256), np.uint8), "mono8")


def motion():
    return sent("/odom", ros.odometry(START_NS, next(iter(ONE.recording().moments())).motion[0]))


def rig(**mounts):
    """The messages of a drive with cameras and a LiDAR."""
    world = replace(street(1), frames=6, cameras=mounts)

    def moments():
        for index, moment in enumerate(world.recording().moments()):
            sweep = seen(moment.stamp_ns, Drive(8.0).pose_at(moment.stamp_ns - START_NS), [(9.0, 2.0)])
            yield moment if index % 2 else replace(moment, sweeps={"top": sweep})

    return RigBag(replace(world.recording(), moments=moments), Coding(labels="")).messages()


def test_the_drafted_map_of_two_cameras_and_a_lidar_gives_logs_and_a_grid_of_both(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_bag(tmp_path / "drive", rig(back=Mount(3.0), front=Mount(0.1)))
    for line in ("convert ros2 drive --inspect", "convert ros2 drive logs --workers 1", "check logs"):
        ended = run_command(line.split())
        assert ended.code == 0, ended.err
    assert list(load_map(tmp_path / "map.yaml").cameras) == ["front", "back"], "what looks ahead comes first"
    (log,) = find_logs(tmp_path / "logs")
    with LogReader(log) as reader:
        assert reader.scene.cameras == ("back", "front")
        assert [len(list(reader.frames(name))) for name in reader.scene.cameras] == [6, 6]
        assert reader.lidars == ("top",)
    spec = GridSpec(agent_row=64)
    sensors = {name: CameraSensor(camera=name) for name in ("front", "back")}
    (grids,) = build_log(log, GridConfig(spec=spec, sensors=sensors, target=("front", "back")))
    front, back, both = (grids.grids != UNKNOWN).any(axis=1)
    assert front[:60].any()
    assert not front[68:].any()
    assert back[68:].any()
    assert not back[:60].any()
    assert (both == (front | back)).all()


def test_pictures_are_paired_by_names_where_frames_do_not_tell(tmp_path):
    told = cameras(drafted(tmp_path, rig(front=Mount(), left=Mount(1.5), rear=Mount(3.0))))
    assert list(told) == ["front", "left", "rear"]
    for name, topics in told.items():
        assert topics == {part: f"/{name}/{part}" for part in ("image", "info", "disparity", "labels")}


def test_depth_and_labels_are_paired_by_frame_and_what_lacks_a_camera_is_said(tmp_path):
    text = drafted(
        tmp_path,
        [
            motion(),
            *(info(f"/{name}/color/camera_info") for name in ("one", "two")),
            *(image(f"/{name}/color/image_raw", f"{name}_color") for name in ("one", "two")),
            depth("/first/depth", "one_color"),
            depth("/second/depth", "two_color"),
            depth("/two/depth/image", "two_depth"),
            labels("/net_a/labels", "two_color"),
            labels("/net_b/labels", "nobody"),
        ],
    )
    told = cameras(text)
    assert (told["one"]["depth"], told["two"]["depth"]) == ("/first/depth", "/second/depth")
    assert "labels" not in told["one"]
    assert told["two"]["labels"] == "/net_a/labels"
    assert "# /net_b/labels: neither its frame nor its name tells of which camera it is: left out.\n" in text


def test_pairs_are_matched_and_a_camera_that_looks_right_is_one_of_its_own(tmp_path):
    pairs = [(rig, side) for rig in ("fore", "aft") for side in ("left", "right")]
    text = drafted(
        tmp_path,
        [
            motion(),
            *(info(f"/{rig}/{side}/camera_info", shift_px=-59.1 if side == "right" else 0.0) for rig, side in pairs),
            *(image(f"/{rig}/{side}/image_rect_color", f"{rig}_left") for rig, side in pairs),
            info("/right/camera_info"),
            image("/right/image_rect", "right"),
            depth("/right/depth", "right"),
        ],
    )
    told = cameras(text)
    assert set(told) == {"fore_left", "aft_left", "right"}
    for rig in ("fore", "aft"):
        assert told[f"{rig}_left"]["right"] == f"/{rig}/right/image_rect_color"
        assert told[f"{rig}_left"]["right_info"] == f"/{rig}/right/camera_info"
    assert told["right"]["depth"] == "/right/depth"


def test_a_camera_without_calibration_is_left_out_and_the_others_stay(tmp_path):
    text = drafted(tmp_path, [*rig(front=Mount()), image("/side/image", "side")])
    assert list(cameras(text)) == ["front"]
    assert "# /side/image: no CameraInfo of its own is in the bag: left out.\n" in text
    ended = run_command(["convert", "ros2", f"{tmp_path}/drive", f"{tmp_path}/logs", "--map", f"{tmp_path}/map.yaml"])
    assert ended.code == 0, ended.err


def test_a_camera_without_depth_is_drafted_with_what_it_is_good_for_beside_others_and_alone(tmp_path):
    rear = [
        info("/rear/info"),
        image("/rear/image", optical("rear")),
        sent("/tf_static", camera_link("rear", ONE.calibration())),
    ]
    told = (
        "    # Nothing in the bag tells its depth (disparity, depth, or a right image whose CameraInfo has the baseline"
        " in P):\n"
        "    # no grids of its own, but its labels colour a LiDAR's points (colour_from of the sensor), and reports"
        " show it.\n"
    )
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    for here, others in ((alone, [motion()]), (beside, [*rig(front=Mount()), image("/side/image", "side")])):
        here.mkdir()
        text = drafted(here, [*others, *rear])
        assert told in text
        assert "\\n" not in text
    assert cameras(text)["rear"] == {"info": "/rear/info", "image": "/rear/image"}
    assert text.count(told) == 1
    ended = run_command(f"convert ros2 {beside}/drive {beside}/logs --map {beside}/map.yaml --workers 1".split())
    assert ended.code == 0, ended.err


def with_frame(message, frame):
    return message._replace(message=replace(message.message, header=ros.header(START_NS, frame)))


@pytest.mark.parametrize("root", ["", "/sensing"])
@pytest.mark.parametrize("frame", ["cam", "nobody"])
@pytest.mark.parametrize("others", [[], [depth("/rear/depth", "rear")]])
def test_no_camera_gets_the_calibration_of_one_above_it(tmp_path, root, frame, others):
    text = drafted(
        tmp_path,
        [
            motion(),
            with_frame(info(f"{root}/camera_info"), frame),
            image(f"{root}/image_raw", "cam"),
            image(f"{root}/rear/image_raw", "rear"),
            *others,
        ],
    )
    assert cameras(text) == {"front": {"info": f"{root}/camera_info", "image": f"{root}/image_raw"}}
    assert f"# {root}/rear/image_raw: no CameraInfo of its own is in the bag: left out.\n" in text


def test_a_compressed_image_is_beside_the_calibration_of_its_camera(tmp_path):
    file = ros.compressed(START_NS, encode(np.zeros((128, 256, 3), np.uint8)), "png", frame="cam")
    messages = [info("/camera_info"), sent("/image_raw/compressed", file), image("/rear/image_raw", "rear")]
    text = drafted(tmp_path, [motion(), *messages])
    assert cameras(text) == {"front": {"info": "/camera_info", "image": "/image_raw/compressed"}}


def test_a_calibration_above_two_cameras_is_that_of_its_frame(tmp_path):
    images = [image(f"/{name}/image_raw", name) for name in ("ahead", "rear")]
    text = drafted(tmp_path, [motion(), with_frame(info("/camera_info"), "rear"), *images])
    assert cameras(text) == {"front": {"info": "/camera_info", "image": "/rear/image_raw"}}
    assert "# /ahead/image_raw: no CameraInfo of its own is in the bag: left out.\n" in text


def test_what_is_not_known_of_the_only_camera_is_left_open(tmp_path):
    text = drafted(tmp_path, [motion(), image("/rear/image", "rear")])
    assert "    info:  # no CameraInfo of its size in the bag" in text


@pytest.mark.parametrize(
    ("topics", "names"),
    [
        (["/CAM_BACK", "/CAM_FRONT"], ["BACK", "FRONT"]),
        (["/front", "/front_left", "/front_right"], ["front", "front_left", "front_right"]),
        (["/sensing/camera/camera0", "/sensing/camera/camera1"], ["camera0", "camera1"]),
        (["/camera", "/image"], ["camera1", "camera2"]),
    ],
)
def test_cameras_are_named_by_what_is_particular_in_their_topics(tmp_path, topics, names):
    messages = [motion()]
    for topic in topics:
        messages += [info(f"{topic}/camera_info"), image(f"{topic}/image_raw", topic), depth(f"{topic}/depth", topic)]
    told = cameras(drafted(tmp_path, messages))
    assert list(told) == names
    assert [each["image"] for each in told.values()] == [f"{topic}/image_raw" for topic in topics]


def test_no_camera_gets_the_name_of_a_lidar(tmp_path):
    world = ToyWorld(frames=1, cameras={"front": Mount(), "rear": Mount(3.0)})

    def moments():
        for moment in world.recording().moments():
            sweep = seen(moment.stamp_ns, (0.0, 0.0, 0.0), [(9.0, 2.0)])
            yield replace(moment, sweeps={"front/lidar": sweep, "rear/lidar": sweep})

    text = drafted(tmp_path, RigBag(replace(world.recording(), moments=moments)).messages())
    assert list(cameras(text)) == ["front_camera", "rear_camera"]
    assert list(yaml.safe_load(text)["lidars"]) == ["front", "rear"]


def test_of_several_codings_of_one_camera_one_is_drafted(tmp_path):
    messages = list(RecordingBag(ONE.recording(), Variant(labels="")).messages())
    messages += [image("/stereo/left/image_raw", ros.OPTICAL), image("/stereo/left/image_mono", ros.OPTICAL)]
    messages += [info("/back/camera_info"), image("/back/image", optical("back")), depth("/back/depth", "")]
    messages += [sent("/tf_static", camera_link("back", replace(ONE.calibration(), yaw_rad=2.8)))]
    told = cameras(drafted(tmp_path, messages))
    assert {name: each["image"] for name, each in told.items()} == {
        "stereo_left": "/stereo/left/image_rect_color",
        "back": "/back/image",
    }
    assert told["stereo_left"]["disparity"] == "/stereo/disparity"
