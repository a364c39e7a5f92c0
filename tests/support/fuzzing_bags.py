"""Bags that `tools/fuzz.py` changes: small ones of both storages, converted as `convert ros2` does it."""

from pathlib import Path

from support.bags import RecordingBag, Variant
from support.coloured import coloured
from support.driving import driving

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

STORAGES = ("mcap", "sqlite3")
MAP = "map.yaml"


def bag_inputs(folder: Path) -> dict[str, bytes]:
    """Write a bag of each storage and its map; what is changed are the files that hold the messages."""
    found = {}
    for storage in STORAGES:
        variant = Variant(storage, image="png", labels="png")
        bag = RecordingBag(coloured(driving(frames=3, size=(64, 32))), variant).write(folder / storage)
        (folder / MAP).write_text(variant.map_text)
        (messages,) = (path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
        found[f"{storage}/{messages.name}"] = messages.read_bytes()
    return found


def read_bag(folder: Path, name: str) -> object:
    """Convert the bag that a file belongs to; a bag that fails is refused with its line."""
    options = Ros2Options(bag=((folder / name).parent,), map=str(folder / MAP))
    summary = convert_bags(options, folder / "logs")
    for reason in summary.failed.values():
        raise InputError(reason)
    return len(summary.labels)
