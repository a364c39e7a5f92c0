import pytest

from semgrid_eval.playback.layout import viewer_layout


def panels(node):
    """All panels of a layout from top left to bottom right."""
    return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])


@pytest.mark.parametrize("camera", [None, "front"])
@pytest.mark.parametrize("rows", [[False], [True], [True, False, True, True]])
@pytest.mark.parametrize("inputs", [True, False])
def test_every_panel_is_placed_once_and_configured(camera, rows, inputs):
    layout = viewer_layout(rows, camera, inputs=inputs)
    placed = panels(layout["layout"])
    assert sorted(placed) == sorted(layout["configById"])
    assert len(set(placed)) == len(placed)
    assert ("Image!image" in placed) == bool(camera)
    assert ("3D!input" in placed) == inputs
    assert "Image!legend" in placed


def test_pictures_are_those_of_the_camera():
    shown = viewer_layout([True], "front")["configById"]
    assert shown["Image!label"]["imageMode"]["imageTopic"] == "/camera/front/label"
    assert shown["Image!label"]["imageMode"]["calibrationTopic"] == "/camera/front/calibration"
    assert shown["Image!legend"]["imageMode"] == {"imageTopic": "/grid/legend"}


def test_without_a_camera_a_lidars_points_are_shown():
    layout = viewer_layout([True], None, "top")
    assert "Image!image" not in panels(layout["layout"])
    assert layout["configById"]["Image!points"]["imageMode"] == {"imageTopic": "/lidar/top/label"}
    assert "Image!points" in panels(layout["layout"])


def test_each_row_has_a_panel_and_certainty_only_where_it_has_one_all_in_their_own_colours():
    shown = viewer_layout([False, True], None)["configById"]
    assert list(shown["3D!input"]["topics"])[:2] == ["/grid/input/1/1", "/grid/input/1/2"]
    assert list(shown["3D!target"]["topics"]) == ["/grid/target", "/grid/mask/1"]
    assert list(shown["3D!prediction1"]["topics"]) == ["/grid/prediction/1", "/grid/prediction/1/name"]
    assert list(shown["3D!prediction2"]["topics"]) == ["/grid/prediction/2", "/grid/prediction/2/name"]
    assert [name for name in shown if "certainty" in name] == ["3D!certainty2"]
    for name in ("3D!input", "3D!target", "3D!prediction2", "3D!certainty2"):
        settings = next(iter(shown[name]["topics"].values()))
        assert (settings["visible"], settings["colorMode"]) == (True, "rgba-fields")


def test_panels_have_titles_for_foxglove_and_for_lichtblick_that_tell_them_apart():
    shown = viewer_layout([True, True], "front")["configById"]
    titles = [panel["foxglovePanelTitle"] for panel in shown.values()]
    assert titles == [panel["lichtblickPanelTitle"] for panel in shown.values()]
    assert len(set(titles)) == len(titles) == 9


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
PANEL = RENDERER | {"foxglovePanelTitle", "lichtblickPanelTitle", "imageMode"}
CAMERA = {"perspective", "distance", "phi", "thetaOffset", "fovy", "near", "far"}
CAMERA_POINTS = {"targetOffset": 3, "target": 3, "targetOrientation": 4}
IMAGE_MODE = {"imageTopic", "calibrationTopic"}
GRID = {"visible", "colorMode", "colorField", "interpolationMethod"}


@pytest.mark.parametrize("camera", [None, "front"])
def test_the_layout_has_the_form_that_viewers_read(camera):
    """As Lichtblick's `LayoutData` and `RendererConfig`, and Foxglove's layout types, have it."""
    layout = viewer_layout([True, False], camera)
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
        assert set(panel["imageMode"]) in ([IMAGE_MODE, {"imageTopic"}] if kind == "Image" else [set()])
        for settings in panel["topics"].values():
            assert set(settings) in (GRID, {"visible"})
            if set(settings) == {"visible"}:  # of a scene
                continue
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
