"""What is wrong with a bag or its map is one line that names bag, topic and value; nothing is written then."""

from dataclasses import replace

import numpy as np
import pytest
from support.bad_bags import MESSAGES, TEXT, WORLD, fault
from support.bags import IMAGE, RecordingBag, Sent, Variant, write_bag
from support.ros_messages import camera_info, image, kind, matrix
from support.toy_world import HEIGHT, START_NS, WIDTH

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.mapping import load_map


def changed(topic, change, *, last=False):
    """Return the messages with the first or the last one of a topic changed."""
    messages = list(MESSAGES)
    places = [number for number, each in enumerate(messages) if each.topic == topic]
    place = places[-1 if last else 0]
    messages[place] = messages[place]._replace(message=change(messages[place].message))
    return messages


def without(topic):
    return [each for each in MESSAGES if each.topic != topic]


def shifted(topic, by_ns):
    """Let the header stamps of a topic jump in the middle of the bag."""
    middle_ns = MESSAGES[len(MESSAGES) // 2].received_ns
    found = []
    for each in MESSAGES:
        message = each.message
        if each.topic == topic and each.received_ns >= middle_ns:
            stamp = message.header.stamp
            now_ns = stamp.sec * 10**9 + stamp.nanosec + by_ns
            moved = replace(stamp, sec=now_ns // 10**9, nanosec=now_ns % 10**9)
            message = replace(message, header=replace(message.header, stamp=moved))
        found.append(each._replace(message=message))
    return found


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path):
    line = fault(tmp_path, without("/odom"))
    assert line.startswith("drive: /odom: is not in the bag, which holds: /labels (sensor_msgs/msg/Image), ")
    assert "/tf_static (tf2_msgs/msg/TFMessage)" in line


@pytest.mark.parametrize(("by_ns", "shown"), [(-5 * 10**9, "-4.941"), (3600 * 10**9, "+3600.059")])
@pytest.mark.parametrize("topic", [IMAGE, "/odom"])
def test_a_clock_that_jumps_is_refused(tmp_path, topic, by_ns, shown):
    line = fault(tmp_path, shifted(topic, by_ns))
    assert line.startswith(f"drive: {topic}: the clock of its header stamps jumps by {shown} s, at ")
    assert line.endswith("while the recorder's goes on by 0.059 s")


def test_stamps_that_are_all_zero_are_refused_with_what_helps(tmp_path):
    messages = []
    for each in MESSAGES:
        zero = kind("builtin_interfaces/Time")(sec=0, nanosec=0)
        message = each.message
        if each.topic == "/labels":
            message = replace(message, header=replace(message.header, stamp=zero))
        messages.append(each._replace(message=message))
    line = fault(tmp_path, messages)
    assert line == (
        "drive: /labels: header stamps are all zero; `clock: received` in the map takes the recorder's instead"
    )


def test_no_calibration(tmp_path):
    empty = camera_info(1, (WIDTH, HEIGHT), np.zeros((3, 3)), p=False)
    messages = [each._replace(message=empty) if "left/camera_info" in each.topic else each for each in MESSAGES]
    line = fault(tmp_path, messages)
    assert line == "drive: /stereo/left/camera_info: is not a calibration: K and P are zero"


def test_no_message_with_a_calibration(tmp_path):
    connection = "/stereo/left/camera_info"
    late = [each for each in MESSAGES if each.topic != connection]
    assert fault(tmp_path, late).startswith(f"drive: {connection}: is not in the bag")


def test_calibration_of_another_size(tmp_path):
    k = matrix(WORLD.calibration())
    messages = [
        each._replace(message=camera_info(1, (640, 480), k)) if "left/camera_info" in each.topic else each
        for each in MESSAGES
    ]
    line = fault(tmp_path, messages)
    assert line == f"drive: {IMAGE}: is 256 x 128, but /stereo/left/camera_info calibrates 640 x 480"


def test_calibration_that_changes(tmp_path):
    k = matrix(WORLD.calibration())
    topic = "/stereo/left/camera_info"
    line = fault(tmp_path, changed(topic, lambda _: camera_info(START_NS + 9, (WIDTH, HEIGHT), 2 * k), last=True))
    assert line == f"drive: {topic}: changes at {START_NS + 9} ns; a recording has one calibration"


def test_calibration_that_contradicts_the_disparity(tmp_path):
    topic = "/stereo/disparity"
    messages = [
        each._replace(message=replace(each.message, f=300.0)) if each.topic == topic else each for each in MESSAGES
    ]
    line = fault(tmp_path, messages)
    assert line == f"drive: {topic}: f is 300 px, but the calibration says 282.75 px"


def test_a_right_camera_on_the_left(tmp_path):
    k = matrix(WORLD.calibration())
    messages = [
        each._replace(message=camera_info(1, (WIDTH, HEIGHT), k, shift_px=80.0)) if "right" in each.topic else each
        for each in MESSAGES
    ]
    line = fault(tmp_path, messages)
    assert "P says that the right camera is -0.28" in line


def test_mixed_encodings(tmp_path):
    mono = image(START_NS + 200_000_000, np.zeros((HEIGHT, WIDTH), np.uint8), "mono8")
    line = fault(tmp_path, changed(IMAGE, lambda _: mono, last=True))
    assert line == (
        f"drive: {IMAGE}: begins as rgb8 of 256 x 128 and is mono8 of 256 x 128 at {START_NS + 200_000_000} ns"
    )


@pytest.mark.parametrize(
    ("topic", "encoding", "said"),
    [
        (IMAGE, "bayer_rggb8", "is bayer_rggb8; record what image_proc makes of it (image_color or image_rect_color)"),
        (IMAGE, "yuv422", "is yuv422; image is read from bgr8, rgb8, bgra8, rgba8, mono8, png, jpeg"),
        ("/labels", "rgb8", "is rgb8; labels is read from mono8, 8UC1, png"),
    ],
)
def test_encodings_that_are_not_read(tmp_path, topic, encoding, said):
    line = fault(tmp_path, changed(topic, lambda message: replace(message, encoding=encoding)))
    assert line == f"drive: {topic} at {START_NS} ns: {said}"


def test_jpeg_labels(tmp_path):
    text = TEXT.replace("labels: /labels", f"labels: {IMAGE}")
    bag = RecordingBag(WORLD.recording(), Variant(image="jpeg"))
    assert "is jpeg; JPEG changes values, so labels is read from mono8" in fault(tmp_path, bag.messages(), text=text)


def test_a_label_that_the_map_does_not_name(tmp_path):
    text = TEXT.replace("ids: label_ids", "ids: {road: [7], sky: [23]}")
    assert "front at 1000000000000000000 ns: ids: " in fault(tmp_path, MESSAGES, text=text)


def test_a_missing_link(tmp_path):
    line = fault(tmp_path, without("/tf_static"))
    assert line == "drive: tf: no link from base_link to camera_left_optical; there are: none"


def test_a_link_that_moves(tmp_path):
    def moved(message):
        first, second = message.transforms
        place = replace(first.transform.translation, x=9.0)
        return replace(
            message, transforms=[replace(first, transform=replace(first.transform, translation=place)), second]
        )

    (told,) = (each for each in MESSAGES if each.topic == "/tf_static")
    again = Sent("/tf_static", MESSAGES[-1].received_ns, moved(told.message))
    line = fault(tmp_path, [*MESSAGES, again])
    assert line == "drive: tf: the link base_link -> camera moves; a sensor has to be fixed"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            f"image: {IMAGE}",
            "image: /odom",
            "/odom: is nav_msgs/msg/Odometry; image is read from sensor_msgs/msg/Image",
        ),
        ("topic: /odom", "topic: /labels", "/labels: is sensor_msgs/msg/Image; speed is read from nav_msgs/msg/Odom"),
        (
            "disparity: /stereo/d",
            "depth: /stereo/d",
            "is stereo_msgs/msg/DisparityImage; depth is read from sensor_msgs",
        ),
    ],
)
def test_types_that_do_not_fit(tmp_path, old, new, said):
    assert said in fault(tmp_path, MESSAGES, text=TEXT.replace(old, new))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_type_that_ros_itself_does_not_have(tmp_path, storage):
    strange = Sent("/mine", MESSAGES[0].received_ns, kind("my_msgs/Pose")(x_m=1.0))
    write_bag(tmp_path / "drive", [strange, *MESSAGES], storage)
    line = fault(tmp_path, text=TEXT.replace("topic: /odom", "topic: /mine"))
    assert line == (
        "drive: /mine: is my_msgs/msg/Pose; speed is read from nav_msgs/msg/Odometry or geometry_msgs/msg/TwistStamped"
    )


def test_pictures_that_never_meet(tmp_path):
    messages = shifted("/labels", 0)
    moved = []
    for each in messages:
        message = each.message
        if each.topic == "/labels":
            stamp = replace(message.header.stamp, nanosec=message.header.stamp.nanosec + 25_000_000)
            message = replace(message, header=replace(message.header, stamp=stamp))
        moved.append(each._replace(message=message))
    line = fault(tmp_path, moved)
    assert line == (
        "drive: /labels: none is within 0.01 s of /stereo/disparity; the nearest is 0.025 s away "
        "(tolerance_s in the map)"
    )


def test_motion_at_another_time(tmp_path):
    messages = [
        each._replace(message=replace(each.message, header=replace(each.message.header, stamp=stamp_later(each))))
        if each.topic == "/odom"
        else each
        for each in MESSAGES
    ]
    assert fault(tmp_path, messages) == "drive: gives no recording; frames left out: 4 without motion"


def stamp_later(each):
    stamp = each.message.header.stamp
    return replace(stamp, sec=stamp.sec + 60)


def test_motion_that_is_not_finite(tmp_path):
    def broken(message):
        message.twist.twist.linear.x = float("nan")
        return message

    from copy import deepcopy

    line = fault(tmp_path, changed("/odom", lambda message: broken(deepcopy(message))))
    assert line == f"drive: /odom: nan at {START_NS} ns is not finite"


def map_fault(here, text):
    (here / "map.yaml").write_text(text)
    with pytest.raises(InputError) as raised:
        load_map(here / "map.yaml")
    return str(raised.value).removeprefix(f"{here}/")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("disparity: /s", "disparty: /s", "cameras.front.disparty: unknown key; allowed here: baseline_m, depth, "),
        ("    disparity: /stereo/disparity\n", "", "right_info needs one of disparity, depth, right"),
        (
            "disparity:",
            "depth: /d\n    disparity:",
            "one of disparity, depth, right at most, not disparity and depth",
        ),
        ("ids: label_ids", "ids: {rode: [1]}", "'rode' is not one of unlabeled, "),
        ("ids: label_ids", "ids: {road: [1], car: [2, 1]}", "ids: 1 is given to road and to car"),
        ("rectified: true", "rectified: 1", "cameras.front.rectified: "),
        ("right_info: /stereo/right/camera_info", "extrinsics: {x_m: , y_m: 0.0, z_m: 1.0}", "extrinsics.x_m: "),
    ],
)
def test_maps_that_cannot_be_used(tmp_path, old, new, said):
    assert said in map_fault(tmp_path, TEXT.replace(old, new))


def test_no_map(tmp_path):
    with pytest.raises(InputError, match="is missing; make a first one with: semgrid-eval convert ros2 BAG --inspect"):
        load_map(tmp_path / "map.yaml")
