"""Bags that `tools/fuzz.py` changes: small ones of both storages, of a camera and of a LiDAR.

A bag `NAME/...` has the map `NAME.yaml`.
"""

from pathlib import Path

from support.bags import RecordingBag, Variant
from support.coloured import coloured
from support.driving import driving
from support.fuzzing_clouds import MAP, SWEPT, messages_of

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

STORAGES = ("mcap", "sqlite3")


def bag_inputs(folder: Path) -> dict[str, bytes]:
    """Write bags of each storage and their maps; what is changed are the files that hold the messages."""
    found = {}
    for storage in STORAGES:
        variant = Variant(storage, image="png", labels="png")
        seen = RecordingBag(coloured(driving(frames=3, size=(64, 32))), variant).write(folder / storage)
        scans = SWEPT.write(folder / f"lidar-{storage}", storage)
        maps = {seen: variant.map_text, scans: MAP}
        for bag, text in maps.items():
            bag.with_suffix(".yaml").write_text(text)
            messages = messages_of(bag)
            found[f"{bag.name}/{messages.name}"] = messages.read_bytes()
    return found


def read_bag(folder: Path, name: str) -> object:
    """Convert the bag that a file belongs to; a bag that fails is refused with its line."""
    bag = (folder / name).parent
    summary = convert_bags(Ros2Options(bag=(bag,), map=str(bag.with_suffix(".yaml"))), folder / "logs")
    for reason in summary.failed.values():
        raise InputError(reason)
    return len(summary.labels)
