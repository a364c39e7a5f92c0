import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from support.driving import CALIBRATION, FRAME_NS, START_NS, driving

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.labels import label_palette
from semgrid_eval.log.codec import Scene
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.recording.png import decode_gray, read_header, with_palette
from semgrid_eval.recording.types import Quantity


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "street.mcap"
    write_log(driving(), path)
    return path


@pytest.fixture
def log(log_path):
    with LogReader(log_path) as reader:
        yield reader


def rewritten(moments):
    return replace(driving(), moments=lambda: iter(moments))


def test_scene_comes_back(log):
    assert log.scene == Scene("street", "synthetic", "val", ("front",), "d" * 16, CLASS_NAMES)


def test_conditions_come_back_exactly_where_there_are_some(log, tmp_path):
    assert log.conditions() == {}
    told = {"camera.width_px": Quantity(640, "px"), "label.persistence": Quantity(0.1 + 0.2, "kept by the next frame")}
    write_log(replace(driving(), conditions=told), tmp_path / "told.mcap")
    with LogReader(tmp_path / "told.mcap") as reader:
        assert reader.conditions() == told
        assert reader.metadata("semgrid.conditions")["camera.width_px"] == "640 px"
    assert read_recording(tmp_path / "told.mcap").conditions == told


def test_conditions_that_are_no_numbers_are_damage(tmp_path):
    write_log(replace(driving(), conditions={"a": Quantity(float("nan"), "px")}), tmp_path / "a.mcap")
    with LogReader(tmp_path / "a.mcap") as reader, pytest.raises(LogError, match=r"a\.mcap: is damaged: "):
        reader.conditions()


def test_calibration_comes_back_exactly(log):
    assert log.calibration("front") == CALIBRATION


def test_motion_comes_back_exactly_with_gps_where_there_was_some(log):
    written = [sample for moment in driving().moments() for sample in moment.motion]
    assert log.motion() == written
    assert {sample.latitude_deg for sample in written} == {None, 49.1}


def test_poses_come_back_within_rounding(log):
    written = [moment.pose for moment in driving().moments()]
    for read, pose in zip(log.poses(), written, strict=True):
        assert (read.stamp_ns, read.x_m, read.y_m) == (pose.stamp_ns, pose.x_m, pose.y_m)
        assert read.yaw_rad == pytest.approx(pose.yaw_rad, abs=1e-14)


def test_actors_come_back_exactly_even_where_there_are_none(log):
    written = [(moment.stamp_ns, moment.actors) for moment in driving().moments()]
    assert list(log.actors()) == written
    assert written[0][1] == ()


def test_pictures_come_back_byte_by_byte_and_labels_pixel_by_pixel(log):
    written = [moment.cameras["front"] for moment in driving().moments()]
    for read, frame in zip(log.frames("front", images=True), written, strict=True):
        assert read.stamp_ns == frame.stamp_ns
        for field in ("image_file", "disparity_png", "exact_disparity_png", "instance_png"):
            assert getattr(read, field) == getattr(frame, field)
        for field in ("label_png", "exact_label_png"):
            before, after = getattr(frame, field), getattr(read, field)
            assert (before is None) == (after is None)
            if before is not None:
                assert after == with_palette(before, label_palette())
                assert np.array_equal(decode_gray(after, bit_depth=8), decode_gray(before, bit_depth=8))


def test_images_are_left_out_unless_asked_for(log):
    assert [frame.image_file for frame in log.frames("front")] == [None] * 6
    assert sum(frame.image_file is not None for frame in log.frames("front", images=True)) == 2


def test_pictures_of_chosen_channels_come_in_the_order_of_time(log):
    frames = list(log.frames("front", images=True))
    labels = [("label", frame.stamp_ns, frame.label_png) for frame in frames if frame.label_png]
    images = [("image", frame.stamp_ns, frame.image_file) for frame in frames if frame.image_file]
    found = [(each.channel, each.stamp_ns, each.png) for each in log.pictures(["front"], ["image", "label"])]
    assert found == sorted(labels + images, key=lambda entry: (entry[1], entry[0] == "image"))
    assert {picture.camera for picture in log.pictures(["front"], ["image"])} == {"front"}


def test_two_passes_at_once_do_not_disturb_each_other(log):
    alone = list(log.frames("front"))
    pairs = zip(log.frames("front"), log.frames("front"), strict=True)
    assert all(a == b == c for (a, b), c in zip(pairs, alone, strict=True))


def test_unknown_camera_is_named_with_those_there_are(log):
    with pytest.raises(LogError, match=r"street\.mcap: camera: 'rear' is not front, the only choice"):
        log.calibration("rear")
    with pytest.raises(LogError, match=r"street\.mcap: camera: 'rear' is not front, the only choice"):
        next(log.frames("rear"))


def test_same_recording_gives_the_same_bytes(log_path, tmp_path):
    write_log(driving(), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == log_path.read_bytes()


def test_digest_is_that_of_the_content(log, tmp_path):
    for name, recording in {"same": driving(), "shorter": driving(frames=5), "other": driving(digest="e" * 16)}.items():
        write_log(recording, tmp_path / f"{name}.mcap")
    digests = {}
    for path in find_logs(tmp_path):
        with LogReader(path) as other:
            digests[path.stem] = other.digest
    assert digests["same"] == log.digest
    assert len({log.digest, digests["shorter"], digests["other"]}) == 3


def test_a_logs_only_camera_need_not_be_named(log, tmp_path):
    assert log.choose_camera(None) == log.choose_camera("front") == "front"
    write_log(driving(cameras=("rear", "front")), tmp_path / "two.mcap")
    with LogReader(tmp_path / "two.mcap") as two:
        assert two.choose_camera("rear") == "rear"
        with pytest.raises(LogError, match=r"two\.mcap: camera: there are several, name one: front, rear"):
            two.choose_camera(None)


def test_several_cameras_stay_apart(tmp_path):
    write_log(driving(cameras=("rear", "front")), tmp_path / "two.mcap")
    with LogReader(tmp_path / "two.mcap") as log:
        assert log.scene.cameras == ("front", "rear")
        front, rear = list(log.frames("front")), list(log.frames("rear"))
    assert [frame.stamp_ns for frame in front] == [frame.stamp_ns for frame in rear]
    assert front[0].disparity_png != rear[0].disparity_png


def test_motion_between_frames_is_kept_in_order(tmp_path):
    first, second, *_ = driving().moments()
    between = replace(second.motion[0], stamp_ns=first.stamp_ns + FRAME_NS // 3)
    write_log(rewritten([first, replace(second, motion=(between, *second.motion))]), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as log:
        assert [sample.stamp_ns - START_NS for sample in log.motion()] == [0, FRAME_NS // 3, FRAME_NS]
        assert len(list(log.frames("front"))) == 2


def test_moments_out_of_order_are_refused_and_leave_nothing(tmp_path):
    first, second, *_ = driving().moments()
    with pytest.raises(InputError, match=r"street: stamp_ns: motion sample at \d+ ns comes after \d+ ns"):
        write_log(rewritten([second, first]), tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_recording_without_frames_is_refused(tmp_path):
    with pytest.raises(InputError, match="street: holds no frame"):
        write_log(rewritten([]), tmp_path / "log.mcap")


def test_moment_without_cameras_gives_no_frame(tmp_path):
    first, second, *_ = driving().moments()
    write_log(rewritten([first, replace(second, cameras={})]), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as log:
        assert len(list(log.frames("front"))) == 1
        assert len(log.motion()) == 2


def test_failure_of_the_source_leaves_the_log_that_was_there(tmp_path):
    path = tmp_path / "log.mcap"
    write_log(driving(), path)
    before = path.read_bytes()

    def moments():
        yield next(driving().moments())
        raise InputError("is broken", path="camera.json")

    with pytest.raises(InputError, match=r"camera\.json: is broken"):
        write_log(replace(driving(), moments=moments), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_logs_are_found_at_any_depth_sorted_without_unfinished_ones(tmp_path):
    for name in ("b/x.mcap", "a/y/z.mcap", "a/.w.mcap", "a/.u.mcap.12.part", "c.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert find_logs(tmp_path) == [tmp_path / "a/y/z.mcap", tmp_path / "b/x.mcap"]


def test_folder_without_logs_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"holds no \.mcap log"):
        find_logs(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        find_logs(tmp_path / "missing")


# What other programs see, through the reference reader:


def reference(path, topic):
    with path.open("rb") as stream:
        return [(channel, message) for _, channel, message in make_reader(stream).iter_messages(topics=[topic])]


def test_reference_reader_finds_header_attachments_and_metadata(log_path):
    with log_path.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().library.startswith("semgrid-eval/")
        assert {entry.name: entry.data for entry in reader.iter_attachments()} == driving().source_files
        assert [entry.name for entry in reader.iter_metadata()] == ["semgrid.scene"]


def test_label_images_tell_viewers_colours_and_programs_names(log_path):
    (channel, message), *_ = reference(log_path, "/camera/front/label")
    picture = CompressedImage.FromString(message.data)
    assert (picture.format, picture.frame_id) == ("png", "camera_front_optical")
    assert picture.timestamp.seconds * 10**9 + picture.timestamp.nanos == message.log_time == message.publish_time
    assert read_header(picture.data).colour_type == 3
    assert '"26": "car"' in channel.metadata["names"]


def test_vehicle_moves_in_odom_and_grid_never_turns(log_path):
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

    messages = [FrameTransforms.FromString(message.data) for _, message in reference(log_path, "/tf")]
    base = [message.transforms[0] for message in messages]
    grid = [message.transforms[1] for message in messages]
    assert {(t.parent_frame_id, t.child_frame_id) for t in base} == {("odom", "base_link")}
    assert {(t.parent_frame_id, t.child_frame_id) for t in grid} == {("odom", "grid")}
    assert all(a.translation == b.translation for a, b in zip(base, grid, strict=True))
    assert all((t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w) == (0, 0, 0, 1) for t in grid)
    steps_m = [
        math.hypot(b.translation.x - a.translation.x, b.translation.y - a.translation.y) for a, b in pairwise(base)
    ]
    assert steps_m == pytest.approx([(5 + number) * FRAME_NS / 1e9 for number in range(5)])


def test_a_frame_is_given_before_the_next_is_read(log):
    """What lies behind may be damaged: a reader that took it all first would raise at once."""
    middle = log.path.stat().st_size // 2
    data = bytearray(log.path.read_bytes())
    data[middle] ^= 0xFF
    broken = log.path.with_name("broken.mcap")
    broken.write_bytes(data)
    with LogReader(broken) as other:
        frames = other.frames("front")
        assert next(frames) == next(log.frames("front"))
        with pytest.raises(LogError, match=r"broken\.mcap: is damaged"):
            list(frames)


def test_logs_in_linked_folders_are_found_once_and_links_in_a_circle_end(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "logs" / "a").mkdir(parents=True)
    for path in ("elsewhere/x.mcap", "logs/a/y.mcap", "logs/a/.z.mcap.1.part", "logs/.hidden.mcap"):
        (tmp_path / path).touch()
    (tmp_path / "logs" / "linked").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "logs" / "a" / "up").symlink_to(tmp_path / "logs")
    assert [str(path.relative_to(tmp_path)) for path in find_logs(tmp_path / "logs")] == [
        "logs/a/y.mcap",
        "logs/linked/x.mcap",
    ]


@pytest.mark.parametrize("changes", [{"name": "a\0b"}, {"name": "x" * 300}, {"split": "\0"}, {"name": "a/b"}])
def test_a_name_that_no_file_can_have_is_refused_by_writer_and_reader(tmp_path, changes):
    with pytest.raises(InputError, match="is not a file name of at most 200 bytes"):
        write_log(replace(driving(), **changes), tmp_path / "log.mcap")
    entries = replace(Scene("a", "d", "val", (), ""), **changes).to_metadata()
    with pytest.raises(ValueError, match="is not a file name of at most 200 bytes"):
        Scene.from_metadata(entries)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speed_mps": 1e6}, r"speed_mps: 1e\+06 m/s is not within -15 to 70"),
        ({"speed_mps": 1e308}, "speed_mps: "),
        ({"speed_mps": -1e300}, "speed_mps: "),
        ({"speed_mps": float("nan")}, "speed_mps: nan m/s"),
        ({"yaw_rate_radps": 2.0}, "yaw_rate_radps: 2 rad/s is not within -1.5 to 1.5"),
        ({"stamp_ns": 2**63}, "beyond 2"),
    ],
)
def test_motion_that_no_vehicle_has_is_not_converted(tmp_path, changes, message):
    recording = driving()
    moments = [
        replace(moment, motion=tuple(replace(s, **changes) for s in moment.motion)) for moment in recording.moments()
    ]
    with pytest.raises(InputError, match=message):
        write_log(replace(recording, moments=lambda: iter(moments)), tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_cannot_be_decoded_is_not_converted(tmp_path):
    recording = driving()

    def moments():
        for moment in recording.moments():
            broken = {
                name: replace(f, image_file=f.disparity_png[:-30] + f.disparity_png[-12:])
                for name, f in moment.cameras.items()
            }
            yield replace(moment, cameras=broken)

    with pytest.raises(InputError, match=r"/image at \d+ ns: is a damaged PNG file"):
        write_log(replace(recording, moments=moments), tmp_path / "log.mcap")
