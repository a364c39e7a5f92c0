"""What a whole Cityscapes tree gives, where recordings begin, and what the digest is of."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cityscapes_tree import CAMERA, FRAME_NS, Tree, change_json, frames, only, put, sequences

from semgrid_eval.recording.types import CameraCalibration, MotionSample
from semgrid_eval.sources.cityscapes.tree import recording_starts


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path / "src")


# What a whole tree gives


def test_pictures_pass_through_byte_by_byte(tree):
    names = tree.write(range(3))
    for frame, name in zip(frames(only(tree)), names, strict=True):
        assert frame.image_file == tree.image(name).read_bytes()
        assert frame.disparity_png == tree.disparity(name).read_bytes()
        assert frame.label_png is None


def test_motion_and_calibration_are_read(tree):
    (name,) = tree.write([4])
    recording = only(tree).recording()
    stamp_ns = 10**15 + 4 * FRAME_NS
    (moment,) = recording.moments()
    assert moment.motion == (MotionSample(stamp_ns, 5.04, 0.02, 50.7, 6.1, 271.5),)
    assert moment.stamp_ns == stamp_ns
    values = {**CAMERA["intrinsic"], **CAMERA["extrinsic"]}
    assert recording.calibrations["front"] == CameraCalibration(
        values["fx"],
        values["fy"],
        values["u0"],
        values["v0"],
        values["baseline"],
        values["x"],
        values["y"],
        values["z"],
        values["roll"],
        values["pitch"],
        values["yaw"],
    )
    assert recording.source_files == {"front_camera.json": tree.camera(name).read_bytes()}


def test_name_split_and_origin_are_kept(tree):
    tree.write(range(294, 300), sequence=2)
    recording = only(tree, camera_name="left").recording()
    assert (recording.name, recording.split, recording.dataset) == ("aachen_000002_000294", "val", "cityscapes")
    assert recording.group == "aachen"
    assert list(recording.calibrations) == ["left"]


def test_recordings_can_be_streamed_again(tree):
    tree.write(range(2))
    recording = only(tree).recording()
    assert list(recording.moments()) == list(recording.moments())


def test_sequences_of_all_splits_and_cities_come_sorted(tree):
    for split, city in (("val", "ulm"), ("train", "stuttgart_00"), ("test", "bonn"), ("train", "aachen")):
        Tree(tree.root, split=split, city=city).write(range(2))
    found = [(sequence.split, sequence.name) for sequence in sequences(tree)]
    assert found == [
        ("test", "bonn_000000_000000"),
        ("train", "aachen_000000_000000"),
        ("train", "stuttgart_00_000000_000000"),
        ("val", "ulm_000000_000000"),
    ]
    assert {sequence.split for sequence in sequences(tree, split=("val", "test"))} == {"val", "test"}


def test_files_whose_names_begin_with_a_dot_are_ignored(tree, tmp_path):
    tree.gt_fine = True
    for name in tree.write(range(2)):
        put(tmp_path / "labels" / f"{name}_labelIds.png", tree.label())
    plain, labelled = only(tree), only(tree, labels=tmp_path / "labels")
    for path in (*tree.root.rglob("*.*"), *(tmp_path / "labels").iterdir()):
        put(path.with_name(f"._{path.name}"), b"\0\5\x16\7")
    assert sequences(tree) == [plain]
    assert sequences(tree, labels=tmp_path / "labels") == [labelled]


def test_gps_may_be_absent(tree):
    (name,) = tree.write([0])
    change_json(tree.vehicle(name), lambda value: (value.pop("gpsLatitude"), value.update(gpsHeading=None)))
    (moment,) = only(tree).recording().moments()
    (sample,) = moment.motion
    assert (sample.latitude_deg, sample.longitude_deg, sample.heading_deg) == (None, 6.1, None)


def test_camera_may_be_given_for_one_frame_only(tree):
    tree.camera_every_frame = False
    names = tree.write(range(30))
    assert [tree.camera(name).exists() for name in names].index(True) == 19
    assert only(tree).recording().calibrations["front"].fx_px == CAMERA["intrinsic"]["fx"]


def test_sequences_travel_to_another_process(tree):
    tree.write(range(2))
    sequence = only(tree)
    again = pickle.loads(pickle.dumps(sequence))
    assert again == sequence
    assert again.digest() == sequence.digest()


# Where recordings begin


@pytest.mark.parametrize(
    ("numbers", "starts"),
    [
        (range(30), []),
        (range(10), []),
        (range(5, 95), []),
        ([*range(30), *range(31, 61)], [30]),
        ([*range(294, 324), *range(333, 363), *range(363, 393)], [30]),
        ([*range(10), *range(30, 60)], [10]),
        ([*range(10), *range(29, 59)], []),
        ([*range(12), *range(13, 30), *range(100, 130)], [29]),
        ([*range(50), *range(60, 90)], [50]),
        ([*range(50), *range(59, 89)], []),
        ([*range(50), *range(51, 60), *range(61, 91)], [59]),
    ],
)
def test_recordings_are_cut_at_breaks_that_end_a_stretch_of_thirty(numbers, starts):
    assert recording_starts(list(numbers)) == starts


@given(st.lists(st.tuples(st.integers(1, 4), st.integers(1, 40)), min_size=1, max_size=6))
def test_whole_recordings_are_told_apart_by_any_break(plan):
    numbers, expected, now = [], [], 7
    for stretches, pause in plan:
        expected.append(len(numbers))
        numbers += range(now, now + 30 * stretches)
        now += 30 * stretches + pause
    assert recording_starts(numbers) == expected[1:]


@given(st.integers(1, 3), st.integers(1, 28), st.data())
def test_any_loss_inside_a_stretch_of_thirty_is_no_new_recording(stretches, lost, data):
    numbers = list(range(100, 100 + 30 * stretches))
    stretch = data.draw(st.integers(0, stretches - 1))
    first = data.draw(st.integers(1, 29 - lost)) + 30 * stretch
    del numbers[first : first + lost]
    assert recording_starts(numbers) == []


def test_recordings_of_one_running_number_become_several_logs(tree):
    tree.write([*range(294, 324), *range(333, 363)])
    assert [sequence.name[-6:] for sequence in sequences(tree)] == ["000294", "000333"]
    assert [len(sequence.frames) for sequence in sequences(tree)] == [30, 30]


# The digest


def test_digest_changes_with_any_file_and_option_and_with_nothing_else(tree, tmp_path):
    tree.gt_fine = True
    (name,) = tree.write([0])
    put(tmp_path / "labels" / f"{name}.png", tree.label())
    seen = [only(tree).digest()]
    assert only(tree).digest() == seen[0]
    tree.vehicle(name).touch()
    assert only(tree).digest() == seen[0]
    seen += [only(tree, camera_name="left").digest(), only(tree, labels=tmp_path / "labels").digest()]
    for path in (
        *(tree.image(name), tree.disparity(name), tree.vehicle(name)),
        *(tree.timestamp(name), tree.camera(name), tree.gt(name)),
    ):
        path.write_bytes(path.read_bytes() + b" ")
        seen.append(only(tree).digest())
    tree.gt(name).unlink()
    seen.append(only(tree).digest())
    assert len(set(seen)) == len(seen)
