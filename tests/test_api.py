"""The public API, used as its documentation shows it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.own_classes import class_set
from support.small_runs import TINY, WINDOW, write_logs

import semgrid_eval as sg
from semgrid_eval.errors import ConfigError, InputError


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return write_logs(tmp_path_factory.mktemp("logs"))


def test_every_public_name_is_there():
    for name in sg.__all__:
        assert getattr(sg, name) is not None
    assert dir(sg) == sorted(sg.__all__)
    with pytest.raises(AttributeError, match="no attribute 'unheard_of'"):
        sg.unheard_of  # noqa: B018
    assert (Path(sg.__file__).parent / "py.typed").is_file()


def test_importing_it_imports_neither_torch_nor_matplotlib():
    used = "import sys, semgrid_eval; semgrid_eval.DEFAULT_CLASSES"
    code = f"{used}; print({{'torch', 'matplotlib', 'cv2'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_log_becomes_grids_windows_and_scores(logs):
    log = sg.find_logs(logs)[0]
    with sg.open_log(log) as reader:
        assert sum(1 for _ in reader.frames("front")) == 9
    grids = sg.build_grids(log)
    windows = sg.make_windows(grids, sg.WindowConfig(**WINDOW))
    assert len(windows) == 3
    fused = sg.make_model("fuse", windows)
    scored = sg.evaluate(sg.fit(fused, windows), windows)
    batch = windows.batch(slice(None))
    table = sg.score(batch.target.numpy(), scored.prediction, mask=batch.mask.numpy())
    counts = scored.sums["iou", "all"].sum(axis=(0, 1))
    road = sg.CLASS_NAMES.index("road")
    assert table["road"] == counts[road, road] / (counts[road].sum() + counts[:, road].sum() - counts[road, road])
    assert 0 < table["mean_known"] < 1


def test_a_network_is_made_and_fitted_the_same_way_twice(logs):
    windows = sg.make_windows(sg.build_grids(sg.find_logs(logs)[0]), sg.WindowConfig(**WINDOW))
    made = [sg.fit(sg.make_model("ed", windows, TINY["ed"]), windows, device="cpu") for _ in range(2)]
    first, second = (sg.evaluate(model, windows) for model in made)
    np.testing.assert_array_equal(first.prediction, second.prediction)


def test_a_run_becomes_a_data_frame(logs, tmp_path):
    record = sg.run("baselines", logs, tmp_path / "none")
    assert all("windows" in row.failure or "window" in row.failure for row in record.rows)  # nine frames are too few
    matrix = tmp_path / "m.yaml"
    matrix.write_text(f"defaults: {{window: {WINDOW}}}\nrows: [{{name: a, model: newest}}, {{name: b, model: fuse}}]\n")
    sg.run(matrix, logs, tmp_path / "run")
    table = sg.load_run(tmp_path / "run")
    mean = table[(table.division == "all") & (table.column == "mean_known")].set_index("row").value
    assert 0 < mean["a"] <= 1
    assert 0 < mean["b"] <= 1
    assert sg.write_report(tmp_path / "run").is_file()


def test_a_grid_is_drawn_in_metres_with_its_mask_in_white():
    grid = np.full((128, 128), sg.CLASS_NAMES.index("road"), np.uint8)
    mask = np.zeros_like(grid, bool)
    mask[0, 0] = True
    axes = sg.plot_grid(grid, mask=mask)
    (image,) = axes.get_images()
    assert image.get_extent() == [50.0, -50.0, 0.0, 100.0]
    assert image.get_array()[0, 0].tolist() == [255, 255, 255]


def test_own_classes_are_scored_and_drawn_as_they_are():
    named = ({"name": f"c{i}", "category": "all", "colour": [9 * i, 0, 0], "labels": [i]} for i in (1, 2))
    classes = class_set(*named, categories=[{"name": "all"}])
    target, prediction = np.array([[0, 1, 1, 2]], np.uint8), np.array([[0, 1, 2, 2]], np.uint8)
    found = sg.score(target, prediction, classes=classes)
    assert found == {"unknown": 1.0, "c1": 0.5, "c2": 0.5, "all": 0.5, "mean_known": 0.5, "merged_all": 1.0}
    (image,) = sg.plot_grid(target, classes=classes).get_images()
    assert image.get_array()[0].tolist() == [[0, 0, 0], [9, 0, 0], [9, 0, 0], [18, 0, 0]]
    with pytest.raises(InputError, match="prediction: has ids outside 0 to 2"):
        sg.score(target, prediction + 1, classes=classes)


def test_faults_are_told_in_one_line(tmp_path):
    grid = np.zeros((4, 4), np.uint8)
    with pytest.raises(InputError, match=r"score: shapes are \(4, 4\), \(3, 4\) and \(4, 4\)"):
        sg.score(grid, grid[:3])
    with pytest.raises(InputError, match="prediction: has ids outside 0 to 9"):
        sg.score(grid, grid + 10)
    with pytest.raises(ConfigError, match="source: 'bagg' is not one of cityscapes"):
        sg.convert("bagg", tmp_path)
    with pytest.raises(ConfigError, match="unknown key"):
        sg.convert("cityscapes", tmp_path, sourc="x")
