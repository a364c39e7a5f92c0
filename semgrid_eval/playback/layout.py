"""The panels in which Foxglove and Lichtblick show what `play` writes."""

import json
import re
from collections.abc import Sequence
from importlib import resources
from typing import Any

from semgrid_eval.log.topics import GRID_INPUT, GRID_PREDICTION
from semgrid_eval.scores.results import RowRecord

_TEMPLATE = "data/foxglove_layout.json"


def viewer_layout(row: RowRecord, cameras: Sequence[str]) -> dict[str, Any]:
    """Fill the template for a row and the first of the cameras; without a camera, the panels of pictures go."""
    text = resources.files("semgrid_eval").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    text = text.replace("{prediction}", prediction_topic(row.name))
    text = text.replace("{camera}", cameras[0] if cameras else "").replace("{row}", json.dumps(row.name)[1:-1])
    layout: dict[str, Any] = json.loads(text)
    shown = layout["configById"]["3D!input"]["topics"]
    settings = shown.pop(f"{GRID_INPUT}/{{sensor}}")
    shown.update({f"{GRID_INPUT}/{sensor}": settings for sensor in row.facts.sensors})
    if not cameras:
        panels = layout["configById"]
        layout["configById"] = {name: panels[name] for name in panels if not name.startswith("Image!")}
        layout["layout"] = layout["layout"]["second"]
    return layout


def prediction_topic(row_name: str) -> str:
    """Return the topic of a row's predictions; characters that mean something to viewers become underscores."""
    return f"{GRID_PREDICTION}/{re.sub(r'[^A-Za-z0-9_.-]', '_', row_name)}"
