"""Bad ROS 2 bags, what a map file says of them, and their point clouds."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from support import ros_messages as ros
from support.bad.case import Bad, Kind
from support.bags import Sent, write_bag
from support.rig_bags import RigBag
from support.swept import Drive, recorded, seen
from support.toy_world import HEIGHT, WIDTH, street

from semgrid_eval.recording.types import Recording

CONVERT = "convert ros2 drive logs --map map.yaml --workers 1"
PLACES = ((6.0, 2.0), (9.0, -3.0), (12.0, 1.0))
DISPARITY, PICTURES = "    disparity: /front/disparity\n", "    labels: /front/labels\n    image: /front/image\n"
LATE_NS = 3600 * 10**9
Change = Callable[[Any], Any]


@cache
def drive() -> RigBag:
    """A bag of four frames of a camera and four sweeps of a LiDAR."""
    world = street(1, frames=4)

    def moments() -> Iterator[Any]:
        for moment in world.recording().moments():
            sweep = seen(moment.stamp_ns, Drive(world.speed_mps).pose_at(moment.stamp_ns - 10**18), PLACES)
            yield replace(moment, sweeps={"top": sweep})

    recording: Recording = replace(recorded(moments), calibrations={"front": world.calibration()})
    return RigBag(recording)


@cache
def messages() -> tuple[Sent, ...]:
    """Its messages."""
    return tuple(drive().messages())


def map_text() -> str:
    """Its map."""
    return drive().map_text("times: {field: ring, unit: ns}")


def whole() -> None:
    """Write the bag and its map."""
    write_bag(Path("drive"), messages())
    Path("map.yaml").write_text(map_text())


def _bag(words: str, make: Callable[[], Any], storage: str = "mcap") -> Bad:
    def spoil() -> None:
        shutil.rmtree("drive")
        write_bag(Path("drive"), make(), storage)

    return Bad(words, CONVERT, spoil=spoil)


def _changed(words: str, topic: str, change: Change, *, last: bool = False) -> Bad:
    """Change the messages of a topic, or its last one."""

    def make() -> Iterator[Sent]:
        found = [each for each in messages() if each.topic == topic]
        for each in messages():
            is_meant = each is found[-1] if last else each.topic == topic
            yield each._replace(message=change(each.message)) if is_meant else each

    return _bag(words, make)


def _mapped(words: str, old: str, new: str) -> Bad:
    assert old in map_text()
    return Bad(words, CONVERT, {"map.yaml": map_text().replace(old, new).encode()})


def _late(message: Any) -> Any:
    stamp = message.header.stamp
    moved = replace(stamp, sec=stamp.sec + LATE_NS // 10**9)
    return replace(message, header=replace(message.header, stamp=moved))


def _unstamped(message: Any) -> Any:
    zero = replace(message.header.stamp, sec=0, nanosec=0)
    return replace(message, header=replace(message.header, stamp=zero))


def _apart(message: Any) -> Any:
    stamp = message.header.stamp
    moved = replace(stamp, nanosec=stamp.nanosec + 25_000_000)
    return replace(message, header=replace(message.header, stamp=moved))


def _infos(size: tuple[int, int], k: Any) -> Change:
    return lambda message: ros.camera_info(1, size, k, p=k.any())


def _unlinked(child: str) -> Callable[[], Any]:
    """Leave out the transform to a frame."""
    return lambda: (
        each for each in messages() if each.topic != "/tf_static" or each.message.transforms[0].child_frame_id != child
    )


def _strange() -> Iterator[Sent]:
    first = messages()[0]
    yield Sent("/odom", first.received_ns, ros.kind("my_msgs/Pose")(x_m=1.0))
    yield from (each for each in messages() if each.topic != "/odom")


def _gray(message: Any) -> Any:
    stamp = message.header.stamp
    return ros.image(stamp.sec * 10**9 + stamp.nanosec, np.zeros((HEIGHT, WIDTH), np.uint8), "mono8")


def _cut(storage: str) -> Bad:
    ending = {"mcap": "mcap", "sqlite3": "db3"}[storage]

    def spoil() -> None:
        shutil.rmtree("drive")
        write_bag(Path("drive"), messages(), storage)
        file = Path("drive", f"drive.{ending}")
        file.write_bytes(file.read_bytes()[: file.stat().st_size * 3 // 10])

    return Bad(f"the bag was cut off ({storage})", CONVERT, spoil=spoil)


def _field(field: str, **changes: Any) -> Change:
    def change(message: Any) -> Any:
        fields = [replace(each, **changes) if each.name == field else each for each in message.fields]
        return replace(message, fields=fields)

    return change


def _cloud(words: str, change: Change) -> Bad:
    return _changed(f"a cloud {words}", "/top/points", change, last=True)


BAGS = Kind(
    "ROS 2 bags",
    "A bag of four frames of a camera and four sweeps of a LiDAR, converted by a map of its topics.",
    whole,
    (
        _mapped("a topic that is not in the bag", "/odom", "/odometry"),
        _mapped("a LiDAR whose topic is not in the bag", "/top/points", "/velodyne_points"),
        _mapped("a camera with neither images nor labels", f"{DISPARITY}{PICTURES}", ""),
        _mapped("a baseline where nothing tells the depth", DISPARITY, "    baseline_m: 0.5\n"),
        _mapped("a LiDAR whose topic holds images", "/top/points", "/front/image"),
        _bag("a message type that is not known", _strange),
        _changed("a clock that jumps by an hour", "/odom", _late, last=True),
        _changed("stamps that are all zero", "/top/points", _unstamped),
        _changed("no calibration: K and P are zero", "/front/info", _infos((WIDTH, HEIGHT), np.zeros((3, 3)))),
        _changed("a calibration of another image size", "/front/info", _infos((640, 480), np.eye(3) * 300)),
        _changed("images of another encoding than before", "/front/image", _gray, last=True),
        _changed("labels that are 25 ms apart from other pictures", "/front/labels", _apart),
        _cut("mcap"),
        _cut("sqlite3"),
        Bad("a folder without index", CONVERT, spoil=lambda: Path("drive/metadata.yaml").unlink()),
        Bad("a file that is no bag", CONVERT.replace("drive", "map.yaml", 1)),
        Bad("a bag that is not there", CONVERT.replace("drive", "gone", 1)),
        Bad("no map", CONVERT, spoil=lambda: Path("map.yaml").unlink()),
        _bag("tf has no link to the camera", _unlinked("front_optical")),
        _bag("tf has no link to the LiDAR", _unlinked("top")),
    ),
)
CLOUDS = Kind(
    "Point clouds of ROS 2 bags",
    "The same bag. Where nothing else is said, the last of its clouds is at fault.",
    whole,
    (
        _cloud("without x", _field("x", name="range")),
        _cloud("without labels", _field("label", name="colour")),
        _cloud("without times", _field("ring", name="beam")),
        _cloud("with two fields z", _field("label", name="z")),
        _cloud("whose x is a whole number", _field("x", datatype=5)),
        _cloud("whose x has an unknown type", _field("x", datatype=77)),
        _cloud("whose labels are fractions", _field("label", datatype=7)),
        _cloud("whose z reaches beyond a point", _field("z", offset=19)),
        _cloud("whose rows are shorter than its points", lambda message: replace(message, row_step=21)),
        _cloud("with fewer bytes than it says", lambda message: replace(message, data=message.data[:-7])),
        _cloud("of 8,589,934,592 points", lambda message: replace(message, width=2**31, height=4)),
        _cloud("with points of 2 GiB", lambda message: replace(message, point_step=2**31)),
        _mapped("a label that the map does not name", "ids: label_ids", "ids: {road: [7], car: [26]}"),
        _mapped("times in another unit", "{field: ring, unit: ns}", "{field: intensity, unit: s, since: epoch}"),
        _mapped("an unknown unit of times", "unit: ns", "unit: minutes"),
        _mapped("ids of a label that Cityscapes does not have", "ids: label_ids", "ids: {rode: [1]}"),
        _mapped("an id beyond 16 bits", "ids: label_ids", "ids: {road: [65536]}"),
        _mapped("a misspelt key of a LiDAR", "label_field", "lable_field"),
        _mapped("a LiDAR with the name of a camera", "  top:", "  front:"),
    ),
)
KINDS = (BAGS, CLOUDS)
