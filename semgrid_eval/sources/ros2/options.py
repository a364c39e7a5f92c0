"""What can be asked of `convert ros2`."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from semgrid_eval.config import Config

_LONGEST = "Longest recording in seconds; each bag is cut into equal parts.  0: only where frames are missing."
MAP_FILE = "map.yaml"
_MAP = "The map file; with --inspect, the one to write."


class Ros2Options(Config):
    """Which bags, and what they are."""

    bag: tuple[Path, ...]
    map: Annotated[str, Field(description=_MAP)] = MAP_FILE
    split: Annotated[Literal["train", "val", "test"], Field(description="Of all these bags.")] = "val"
    recording_s: Annotated[float, Field(ge=0, le=86_400, description=_LONGEST)] = 30.0
