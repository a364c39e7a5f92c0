"""Bags that fail, and the line that each fails with."""

from support.bags import RecordingBag, Variant, write_bag
from support.toy_world import street

from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

WORLD = street(1, frames=4)
MESSAGES = list(RecordingBag(WORLD.recording()).messages())
TEXT = Variant().map_text


def fault(here, messages=None, *, text=TEXT, bag="drive"):
    """Convert a bag and return the one line that it fails with."""
    if messages is not None:
        write_bag(here / "drive", messages)
    (here / "map.yaml").write_text(text)
    summary = convert_bags(Ros2Options(bag=(here / bag,), map=str(here / "map.yaml")), here / "logs")
    assert summary.written == []
    assert not list(here.glob("logs/**/*.mcap"))
    (line,) = summary.failed.values()
    assert "\n" not in line
    assert line.startswith(str(here))
    return line.removeprefix(f"{here}/")
