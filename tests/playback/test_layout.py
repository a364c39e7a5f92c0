import re

import pytest
from support.fake_run import facts

from semgrid_eval.errors import printable
from semgrid_eval.playback.backdrop import prediction_topic, viewer_layout
from semgrid_eval.scores.results import RowRecord


def row(name="ED-DC", sensors=("full",)):
    return RowRecord(facts=facts("ED", sensors), name=name, label=name)


def panels(node):
    """All panels of a layout from top left to bottom right."""
    return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])


@pytest.mark.parametrize("cameras", [(), ("front",), ("front", "rear")])
def test_every_panel_is_placed_once_and_configured(cameras):
    layout = viewer_layout(row(), cameras)
    placed = panels(layout["layout"])
    assert sorted(placed) == sorted(layout["configById"])
    assert len(set(placed)) == len(placed)
    assert ("Image!image" in placed) == bool(cameras)


def test_pictures_are_those_of_the_first_camera():
    shown = viewer_layout(row(), ("front", "rear"))["configById"]
    assert shown["Image!label"]["imageMode"]["imageTopic"] == "/camera/front/label"
    assert shown["Image!label"]["imageMode"]["calibrationTopic"] == "/camera/front/calibration"


def test_grids_of_the_row_and_all_its_sensors_are_shown_in_their_own_colours():
    shown = viewer_layout(row(sensors=("near", "far")), ())["configById"]
    assert list(shown["3D!input"]["topics"]) == ["/grid/input/near", "/grid/input/far"]
    assert list(shown["3D!target"]["topics"]) == ["/grid/target", "/grid/mask"]
    assert list(shown["3D!prediction"]["topics"]) == ["/grid/prediction/ED-DC"]
    for name in ("3D!input", "3D!target", "3D!prediction", "3D!certainty"):
        for settings in shown[name]["topics"].values():
            assert (settings["visible"], settings["colorMode"]) == (True, "rgba-fields")


@pytest.mark.parametrize("name", ['say "hi" \\ {camera}', "a/b c", "Zürich\n", "\x1b[31mred"])
def test_any_name_of_a_row_gives_a_layout_and_a_plain_topic(name):
    shown = viewer_layout(row(name), ("front",))["configById"]["3D!prediction"]
    assert shown["foxglovePanelTitle"] == f"Prediction of {printable(name)}"
    assert list(shown["topics"]) == [prediction_topic(name)]
    assert re.fullmatch(r"/grid/prediction/[\w.-]+", prediction_topic(name))


RENDERER = {
    "cameraState",
    "followMode",
    "followTf",
    "scene",
    "transforms",
    "topics",
    "layers",
    "publish",
    "synchronize",
}
PANEL = RENDERER | {"foxglovePanelTitle", "imageMode"}
CAMERA = {"perspective", "distance", "phi", "thetaOffset", "fovy", "near", "far"}
CAMERA_POINTS = {"targetOffset": 3, "target": 3, "targetOrientation": 4}
IMAGE_MODE = {"imageTopic", "calibrationTopic"}
GRID = {"visible", "colorMode", "colorField", "interpolationMethod"}


@pytest.mark.parametrize("cameras", [(), ("front",)])
def test_the_layout_has_the_form_that_viewers_read(cameras):
    """As Lichtblick's `LayoutData` and `RendererConfig`, and Foxglove's layout types, have it."""
    layout = viewer_layout(row(), cameras)
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert isinstance(layout["playbackConfig"]["speed"], float | int)
    check_mosaic(layout["layout"])
    for name, panel in layout["configById"].items():
        kind, _, identity = name.partition("!")
        assert kind in ("3D", "Image")
        assert identity
        assert set(panel) <= PANEL
        assert panel["followMode"] in ("follow-pose", "follow-position", "follow-none")
        assert panel["publish"]["type"] in ("point", "pose", "pose_estimate")
        check_camera(panel["cameraState"])
        assert set(panel["imageMode"]) == (IMAGE_MODE if kind == "Image" else set())
        for settings in panel["topics"].values():
            assert set(settings) <= GRID
            assert settings["colorMode"] in ("flat", "gradient", "colormap", "rgba-fields")
            assert settings["interpolationMethod"] in ("linear", "nearestNeighbor")


def check_mosaic(node):
    if isinstance(node, str):
        return
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column")
    assert 0 < node["splitPercentage"] < 100
    check_mosaic(node["first"])
    check_mosaic(node["second"])


def check_camera(state):
    assert set(state) in (set(), CAMERA | set(CAMERA_POINTS))
    for name, value in state.items():
        parts = value if name in CAMERA_POINTS else [value]
        assert len(parts) == CAMERA_POINTS.get(name, 1)
        assert all(isinstance(part, float | int) for part in parts)
