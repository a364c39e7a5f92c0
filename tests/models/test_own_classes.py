"""Models learn and answer in the classes that they are given, however many there are."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml
from support.models import given
from support.own_classes import FILE, class_set
from support.recordings import random_recording

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.fitting import Lesson, fit_model
from semgrid_eval.models.model import Given, one_hot
from semgrid_eval.models.registry import find_model
from semgrid_eval.models.table import SIZE_LIMIT, ClassTable
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

OWN = parse_config(ClassSet, yaml.safe_load(FILE))
TRAINING = {"epochs": 1, "updates_per_epoch": 2, "batch": 2}
SETTINGS = {
    "newest": {},
    "fuse": {},
    "table": {},
    "flow": {"small_speed_limit_mps": 10.0},
    "ed": {"features": 4, "depth": 2, "training": TRAINING, "prior": True},
    "residual": {"widths": [8, 8], "fine": 0, "shift": 1, "training": TRAINING},
    "residual-flow": {"widths": [8, 8], "fine": 4, "training": TRAINING},
}


def many(count):
    labels = ({"name": f"c{i}", "category": "c", "labels": [100 + i]} for i in range(1, count))
    return class_set(*labels, categories=[{"name": "c", "moves": "fast"}])


def windows_of(classes, *, sensors=("full",), inputs=2):
    recording = random_recording(1, frames=9, size=16, sensors=sensors)
    recording = replace(recording, grids=recording.grids % classes.count)
    data = stack_recordings([recording], cell_m=1.0, classes=classes)
    config = WindowConfig(inputs=inputs, step_frames=1, target_frame=None)
    return select_windows(data, training_windows(data.frame_counts, config).windows, sensors=sensors)


@pytest.mark.parametrize("classes", [OWN, many(2), many(64)], ids=["five", "one", "sixty-three"])
@pytest.mark.parametrize("name", SETTINGS)
def test_each_model_answers_in_the_classes_that_it_is_given(name, classes, tmp_path):
    windows, made = windows_of(classes), find_model(name)
    settings = made.parse_settings(SETTINGS[name])
    row = replace(given(), classes=classes)
    made.check(settings, row)
    learned = windows if made.learns() else None
    lesson = Lesson(row, 0, torch.device("cpu"), learned, folder=tmp_path)
    model = fit_model(made, settings, lesson).model
    batch = windows.batch(slice(3))
    with torch.inference_mode():
        scores = model.predict(batch)
    assert scores.shape == (3, classes.count, 16, 16)
    assert 0.0 <= scores.amax(dim=1).min() <= scores.max() <= 1.0 + 1e-5
    if name == "newest":
        assert torch.equal(scores.argmax(dim=1), batch.past[:, 0, -1].long())


def test_what_moves_in_another_set_is_moved_on():
    """A block of `vehicle` drives down a column; by the default set its id is that of vegetation, which stays."""
    grids = np.zeros((1, 9, 16, 16), np.uint8)
    grids[:] = OWN.names.index("drivable")
    for frame in range(9):
        grids[0, frame, 1 + frame : 4 + frame, 5:8] = OWN.names.index("vehicle")
    recording = replace(random_recording(1, frames=9, size=16, sensors=("full",)), grids=grids)
    recording = replace(recording, position_m=np.zeros((9, 2)))
    answers = {}
    for classes in (OWN, DEFAULT_CLASSES):
        data = stack_recordings([recording], cell_m=0.5, classes=classes)
        config = WindowConfig(inputs=2, step_frames=3, target_frame=None)
        windows = select_windows(data, training_windows(data.frame_counts, config).windows, sensors=["full"])
        flow = find_model("flow")
        model = flow(flow.parse_settings({"speed_limit_mps": 100.0}), replace(given(cell_m=0.5), classes=classes))
        answers[classes] = model.predict(windows.batch(slice(1))).argmax(dim=1), windows.batch(slice(1))
    moved, batch = answers[OWN]
    assert torch.equal(moved, batch.target.long())
    stays, batch = answers[DEFAULT_CLASSES]
    assert torch.equal(stays, batch.past[:, 0, -1].long())


def test_a_table_of_many_classes_looks_at_fewer_grids():
    sizes = {}
    for count in (10, 64):
        row = replace(given(inputs=5), classes=many(count))
        model = ClassTable(ClassTable.parse_settings({}), row)
        model.fit(windows_of(many(count), inputs=5))
        sizes[count] = model._probability.numel()
    assert sizes == {10: 10**6, 64: 64**3}
    assert max(sizes.values()) <= SIZE_LIMIT


def test_the_default_classes_are_not_part_of_what_a_training_is_known_by():
    row = Given(("full",), 2, 8, 8, 1.0, translate=True)
    assert set(row.described()) == {"sensors", "inputs", "rows", "columns", "cell_m", "translate"}
    assert replace(row, classes=OWN).described()["classes"] == OWN.identity()
    assert (row.planes, replace(row, classes=OWN).planes) == (20, 12)


def test_the_shipped_network_knows_the_default_classes_alone():
    town = find_model("residual-town")
    row = Given(("full",), 2, 128, 128, 100 / 128, translate=True)
    town.check(town.parse_settings({}), row)
    with pytest.raises(
        ConfigError, match=r"^model: was trained on the default classes, and grid.classes has unknown, d"
    ):
        town.check(town.parse_settings({}), replace(row, classes=OWN))


def test_ids_become_as_many_scores_as_are_asked_for():
    ids = torch.tensor([[[0, 5]]], dtype=torch.uint8)
    assert one_hot(ids).shape == (1, 10, 1, 2)
    assert one_hot(ids, 6)[0, :, 0].T.tolist() == [[1, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]]
