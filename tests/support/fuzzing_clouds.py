"""Bags of a LiDAR that `tools/fuzz.py` changes in what their clouds say: fields, sizes, frames and data."""

import random
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from support import ros_messages as ros
from support.bags import write_bag
from support.fuzzing_ways import Inputs, changed_bytes
from support.rig_bags import RigBag
from support.swept import Drive, scanned

from semgrid_eval.config import load_yaml
from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.convert import convert_bags, inspect
from semgrid_eval.sources.ros2.mapping import BagMap
from semgrid_eval.sources.ros2.options import Ros2Options

PLACES = ((6.0, 2.0), (9.0, -3.0), (12.0, 1.0))
SWEPT = RigBag(scanned(Drive(), range(0, 300_000_000, 100_000_000), PLACES))
MAP = SWEPT.map_text("times: {field: ring, unit: ns}")
TOPIC = "/top/points"
NAMES = ("x", "y", "z", "t", "label", "ring", "intensity", "", "a: b", "a\nb: [", "\x1b[2J", "x" * 300)
MOST = (1 << 32) - 1


def cloud_inputs(folder: Path) -> dict[str, bytes]:
    """Write a bag of each storage and their maps; what is changed are the files that hold the messages."""
    found = {}
    for storage in ("mcap", "sqlite3"):
        bag = SWEPT.write(folder / "clouds" / storage, storage)
        bag.with_suffix(".yaml").write_text(MAP)
        messages = messages_of(bag)
        found[str(messages.relative_to(folder))] = messages.read_bytes()
    return found


def messages_of(bag: Path) -> Path:
    """Return the file that holds the messages of a bag."""
    (found,) = (path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    return found


def changed_clouds(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Write the bag again with changed clouds: the first, any of them or all."""
    odd = chance.choice((0.3, 1.0))
    messages = [
        each._replace(message=changed(each.message, chance)) if each.topic == TOPIC and chance.random() < odd else each
        for each in SWEPT.messages()
    ]
    with tempfile.TemporaryDirectory() as folder:
        return messages_of(write_bag(Path(folder) / "bag", messages, Path(name).parent.name)).read_bytes()


def changed(cloud: Any, chance: random.Random) -> Any:
    """Change a cloud in some ways; half of them have as many bytes as they say."""
    for _ in range(chance.choice((1, 1, 2, 4))):
        cloud = chance.choice(WAYS)(cloud, chance)
    return _resized(cloud, chance) if chance.random() < 0.5 else cloud


def _field(cloud: Any, chance: random.Random) -> Any:
    """Change what one field says of itself."""
    fields = list(cloud.fields)
    if not fields:
        return cloud
    key, values = chance.choice(list(FIELD_VALUES.items()))
    near = chance.choice([chance.choice(fields).offset, cloud.point_step - 1, cloud.point_step, 1])
    at = chance.randrange(len(fields))
    fields[at] = replace(fields[at], **{key: chance.choice((*values, near) if key == "offset" else values)})
    return replace(cloud, fields=fields)


def _fields(cloud: Any, chance: random.Random) -> Any:
    """Leave fields out, repeat or shuffle them."""
    fields = [each for each in cloud.fields for _ in range(chance.choice((1, 1, 1, 1, 1, 0, 2)))]
    chance.shuffle(fields)
    return replace(cloud, fields=fields if chance.random() < 0.9 else [])


def _size(cloud: Any, chance: random.Random) -> Any:
    key = chance.choice(("height", "width", "point_step", "row_step"))
    usual = getattr(cloud, key)
    values = (0, 1, 2, max(usual - 1, 0), min(usual + 1, MOST), 2 * usual % MOST, usual // 2, 1024, 1025, 1 << 31, MOST)
    return replace(cloud, **{key: chance.choice(values)})


def _flags(cloud: Any, chance: random.Random) -> Any:
    key = chance.choice(("is_bigendian", "is_dense"))
    return replace(cloud, **{key: not getattr(cloud, key)})


def _header(cloud: Any, chance: random.Random) -> Any:
    stamp = chance.choice((0, 1, 10**18, (1 << 31) * 10**9 - 1))
    return replace(cloud, header=ros.header(stamp, chance.choice(("top", "base_link", *NAMES))))


def _data(cloud: Any, chance: random.Random) -> Any:
    return replace(cloud, data=np.frombuffer(changed_bytes(cloud.data.tobytes(), chance), np.uint8))


def _values(cloud: Any, chance: random.Random) -> Any:
    """Fill some points with bytes that are NaN, infinite, or huge in one type or another."""
    data = cloud.data.copy()
    pattern = chance.choice((b"\xff", b"\x00", b"\x7f", b"\x00\x00\x80\x7f", b"\x00\x00\x00\x00\x00\x00\xf0\x7f"))
    begin = chance.randint(0, len(data))
    end = chance.randint(begin, len(data))
    data[begin:end] = np.resize(np.frombuffer(pattern, np.uint8), end - begin)
    return replace(cloud, data=data)


def _resized(cloud: Any, chance: random.Random) -> Any:
    """Let rows be as long as points need, or a little longer, and the data as long as they say."""
    row_step = min(cloud.width * cloud.point_step + chance.choice((0, 0, 7)), MOST)
    size = row_step * cloud.height
    if size > 1 << 16:
        return cloud
    data = np.resize(cloud.data, size) if len(cloud.data) else np.zeros(size, np.uint8)
    return replace(cloud, row_step=row_step, data=data)


FIELD_VALUES = {
    "name": NAMES,
    "offset": (0, 1, 1 << 31, MOST),
    "datatype": (*range(10), 255),
    "count": (0, 2, 3, MOST),
}
WAYS: tuple[Callable[[Any, random.Random], Any], ...] = (
    *(_field, _field, _field, _fields, _size, _size),
    *(_flags, _header, _data, _values),
)


def read_clouds(folder: Path, name: str) -> object:
    """Look at the bag, as a user begins, and convert it; one that fails is refused with its line."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a user would see it among the lines that we mean
        return _read(folder, (folder / name).parent)


def _read(folder: Path, bag: Path) -> int:
    _look_at(bag, folder / "draft.yaml")
    summary = convert_bags(Ros2Options(bag=(bag,), map=str(bag.with_suffix(".yaml"))), folder / "logs")
    for reason in summary.failed.values():
        raise InputError(reason)
    return len(summary.labels)


def _look_at(bag: Path, draft: Path) -> None:
    """Make sure that what is said of a bag can be shown, and that the map which is drafted is one."""
    draft.unlink(missing_ok=True)
    told = inspect(Ros2Options(bag=(bag,), map=str(draft)))
    assert all(line.isprintable() for line in told.split("\n")), told
    assert load_yaml(draft).keys() <= BagMap.model_fields.keys()
