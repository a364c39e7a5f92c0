"""The layout of panels for Foxglove and Lichtblick: the same for all rows of a log with the same cameras."""

import math
from collections.abc import Sequence
from typing import Any

from semgrid_eval.log import topics
from semgrid_eval.log.topics import camera_topic

Node = str | dict[str, Any]
_TITLES = ("foxglovePanelTitle", "lichtblickPanelTitle")
"""Keys of a panel's title: of Foxglove, and of Lichtblick, which does not read that of Foxglove."""
_SENSORS = 8  # of a row, shown over each other; what a log does not have is not shown
_REACH_M = 105.0  # that the panels show
_PICTURES_PERCENT = 27.0
_CAMERA_STATE = {
    "perspective": False,
    "distance": _REACH_M,
    "phi": 0,
    "thetaOffset": 90,
    "targetOffset": [50, 0, 0],
    "target": [0, 0, 0],
    "targetOrientation": [0, 0, 0, 1],
    "fovy": 45,
    "near": 0.5,
    "far": 5000,
}


def viewer_layout(
    rows: Sequence[bool], camera: str | None, lidar: str | None = None, *, inputs: bool = True
) -> dict[str, Any]:
    """Lay out panels of grids for the rows of a log, and beside them what a sensor saw, and the legend.

    Args:
        rows: for each row whether it says how sure it is.
        camera: the one whose pictures are shown, if one's are.
        lidar: the one whose pictures are shown, if one's are.
        inputs: whether the log has them.
    """
    pictures, grids = _pictures(camera, lidar), _grids(rows, inputs=inputs)
    beside, above = _divided("column", list(pictures)), _tiled(list(grids))
    return {
        "configById": {**pictures, **grids},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", beside, above, _PICTURES_PERCENT),
    }


def _pictures(camera: str | None, lidar: str | None) -> dict[str, dict[str, Any]]:
    shown = {}
    if camera is not None:
        calibration = camera_topic(camera, topics.CALIBRATION)
        image, label = (camera_topic(camera, channel) for channel in (topics.IMAGE, topics.LABEL))
        shown["Image!image"] = _image("Camera", image, calibration)
        shown["Image!label"] = _image("Labels", label, calibration)
    if lidar is not None:
        shown["Image!points"] = _image("Points, all around", topics.lidar_picture_topic(lidar))
    return {**shown, "Image!legend": _image("Legend", topics.GRID_LEGEND)}


def _grids(rows: Sequence[bool], *, inputs: bool) -> dict[str, dict[str, Any]]:
    newest = [f"{topics.GRID_INPUT}/1/{sensor}" for sensor in range(1, _SENSORS + 1)]
    panels = {"3D!input": _above("Newest input of row 1, moved to the target's time", newest)} if inputs else {}
    panels["3D!target"] = _above("Target; white is left out of scores", [topics.GRID_TARGET, f"{topics.GRID_MASK}/1"])
    for number in range(1, len(rows) + 1):
        topic = f"{topics.GRID_PREDICTION}/{number}"
        panels[f"3D!prediction{number}"] = _above(f"Prediction {number}", [topic], [f"{topic}/name"])
    for number in (number for number, unsure in enumerate(rows, start=1) if unsure):
        title = f"Certainty {number}; white is 1"
        panels[f"3D!certainty{number}"] = _above(title, [f"{topics.GRID_CERTAINTY}/{number}"])
    return panels


def _panel(title: str) -> dict[str, Any]:
    return {
        **dict.fromkeys(_TITLES, title),
        "cameraState": {},
        "followMode": "follow-pose",
        "scene": {},
        "transforms": {},
        "topics": {},
        "layers": {},
        "publish": {"type": "point"},
        "imageMode": {},
    }


def _image(title: str, topic: str, calibration: str | None = None) -> dict[str, Any]:
    known = {} if calibration is None else {"calibrationTopic": calibration}
    return {**_panel(title), "synchronize": False, "imageMode": {"imageTopic": topic, **known}}


def _above(title: str, grids: Sequence[str], scenes: Sequence[str] = ()) -> dict[str, Any]:
    """Look at grids from above, ahead being up."""
    drawn = {
        "visible": True,
        "colorMode": "rgba-fields",
        "colorField": "red",
        "interpolationMethod": "nearestNeighbor",
    }
    return {
        **_panel(title),
        "cameraState": _CAMERA_STATE,
        "followTf": topics.GRID_FRAME,
        "scene": {"backgroundColor": "#000000", "syncCamera": True},
        "topics": {**dict.fromkeys(grids, drawn), **{scene: {"visible": True} for scene in scenes}},
    }


def _divided(direction: str, nodes: Sequence[Node]) -> Node:
    """Put nodes beside or below each other, all of one size."""
    first, *rest = nodes
    return _split(direction, first, _divided(direction, rest), 100 / len(nodes)) if rest else first


def _tiled(nodes: Sequence[Node]) -> Node:
    """Put nodes into a square, line by line: a grid is as wide as it is high."""
    across = math.ceil(math.sqrt(len(nodes)))
    lines = [_divided("row", nodes[start : start + across]) for start in range(0, len(nodes), across)]
    return _divided("column", lines)


def _split(direction: str, first: Node, second: Node, percent: float) -> Node:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": round(percent, 3)}
