import base64
import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.drawing import POINTLESS_COLOUR
from semgrid_eval.report.examples.thumbnails import RunThumbnails, View
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.thumbnails import FramePictures

SPLIT = ("split2_upper", "split2_lower")


@pytest.fixture(scope="module")
def view(seen):
    (run,) = load_runs([seen])
    row = next(row for row in run.rows if row.name == "own-Sp2")
    window = row.shown.record.windows[1]
    return View(window, RunThumbnails(run).of(window.log, row.shown), GridConfig(), SPLIT)


def decoded(uri):
    kind, data = uri.removeprefix("data:").split(";base64,")
    return kind, np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def with_frame(view, **files):
    """Give the view's target other pictures."""
    frames = {view.window.target_stamp_ns: FramePictures(**files)}
    return dataclasses.replace(view, kept=dataclasses.replace(view.kept, frames=frames))


def test_camera_and_segmentation_of_a_time_are_shown_in_the_colours_of_grids(view):
    camera, labels = view.photos(view.window.target_stamp_ns, "at the target's time")
    assert (camera.kind, camera.alt) == ("camera", "Camera image, at the target's time")
    kind, image = decoded(camera.uri)
    assert (kind, image.shape) == ("image/webp", (128, 256, 3))
    kind, classes = decoded(labels.uri)
    assert (kind, classes.shape) == ("image/png", (128, 256, 3))
    assert tuple(classes[0, 128]) == POINTLESS_COLOUR, "above the street is sky"
    assert tuple(classes[-1, 128]) == tuple(DEFAULT_CLASSES.palette(safe=True)[CLASS_NAMES.index("road")])
    assert {CLASS_COUNT + 1, CLASS_NAMES.index("road"), CLASS_NAMES.index("building")} <= labels.colours


def test_labels_follow_the_class_map_of_the_run(view):
    mapped = dataclasses.replace(view, grid=GridConfig(class_map={"road": "car"}))
    _, labels = mapped.photos(view.window.target_stamp_ns, "now")
    assert tuple(decoded(labels.uri)[1][-1, 128]) == tuple(DEFAULT_CLASSES.palette(safe=True)[CLASS_NAMES.index("car")])


def test_pictures_that_are_missing_or_damaged_are_left_out(view):
    now = view.window.target_stamp_ns
    assert not list(view.photos(now + 1, "later"))
    assert not list(view.photos(None, "unknown"))
    assert not list(dataclasses.replace(view, kept=None).photos(now, "now"))
    assert not list(with_frame(view).photos(now, "now"))
    damaged = with_frame(view, image=b"anything", label=b"\x89PNG damaged").photos(now, "now")
    assert [picture.kind for picture in damaged] == ["camera"]


def test_sensors_are_framed_where_they_look(view):
    upper, lower = view.crops
    assert (upper.name, lower.name) == SPLIT
    assert (upper.top, upper.top + upper.height) == pytest.approx((0, 100 * 125 / 256))
    assert (lower.top, lower.top + lower.height) == pytest.approx((100 * 145 / 256, 100))
    assert (lower.left, lower.width) == pytest.approx((100 * 40 / 512, 100 * 432 / 512))
    assert dataclasses.replace(view, sensors=("full",)).crops == ()


def test_only_what_no_sensor_sees_is_hatched(view):
    assert view.hatching.startswith("data:image/png;base64,")
    for sensors in (("full",), ("split1_upper", "split1_lower")):
        assert dataclasses.replace(view, sensors=sensors).hatching == ""
    assert dataclasses.replace(view, kept=None).hatching == ""


def test_inputs_are_told_by_their_time_before_the_target(view):
    told = [view.before(stamp_ns) for stamp_ns in view.window.input_stamps_ns]
    assert told == ["0.235 s before the target", "0.118 s before the target"]
