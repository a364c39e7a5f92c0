"""Bags that `tools/fuzz.py` changes: small ones of both storages, of a camera and of a LiDAR.

A bag `NAME/...` has the map `NAME.yaml`.
"""

from pathlib import Path

from support.bags import RecordingBag, Variant
from support.coloured import coloured
from support.driving import driving
from support.rig_bags import RigBag
from support.swept import Drive, scanned

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

STORAGES = ("mcap", "sqlite3")
PLACES = ((6.0, 2.0), (9.0, -3.0), (12.0, 1.0))


def bag_inputs(folder: Path) -> dict[str, bytes]:
    """Write bags of each storage and their maps; what is changed are the files that hold the messages."""
    found = {}
    swept = RigBag(scanned(Drive(), range(0, 300_000_000, 100_000_000), PLACES))
    for storage in STORAGES:
        variant = Variant(storage, image="png", labels="png")
        seen = RecordingBag(coloured(driving(frames=3, size=(64, 32))), variant).write(folder / storage)
        scans = swept.write(folder / f"lidar-{storage}", storage)
        maps = {seen: variant.map_text, scans: swept.map_text("times: {field: ring, unit: ns}")}
        for bag, text in maps.items():
            bag.with_suffix(".yaml").write_text(text)
            (messages,) = (path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
            found[f"{bag.name}/{messages.name}"] = messages.read_bytes()
    return found


def read_bag(folder: Path, name: str) -> object:
    """Convert the bag that a file belongs to; a bag that fails is refused with its line."""
    bag = (folder / name).parent
    summary = convert_bags(Ros2Options(bag=(bag,), map=str(bag.with_suffix(".yaml"))), folder / "logs")
    for reason in summary.failed.values():
        raise InputError(reason)
    return len(summary.labels)
