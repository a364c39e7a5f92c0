"""Models of one's own: found by file or entry point, and every wrong answer told in one line."""

import importlib.metadata

import pytest
import torch
from support.recordings import random_recording

from semgrid_eval.errors import InputError
from semgrid_eval.models.predictor import ENTRY_POINT_GROUP, CheckedPredictor, load_predictor, one_hot
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import Window

OWN_MODEL = """
import torch

class Newest(torch.nn.Module):
    def forward(self, batch):
        assert not self.training
        return torch.nn.functional.one_hot(batch.past[:, 0, -1].long(), 10).permute(0, 3, 1, 2).float()

class Broken:
    def __init__(self):
        raise ValueError("weights are\\nmissing")

constant = 7
def gives_text():
    return "text"
"""


@pytest.fixture
def batch():
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    return select_windows(data, [Window(0, (0, 5), 10), Window(0, (1, 6), 11)], sensors=["full"]).batch(slice(None))


@pytest.fixture
def own_model(tmp_path):
    path = tmp_path / "own_model.py"
    path.write_text(OWN_MODEL)
    return path


def test_class_in_a_file_becomes_a_predictor(own_model, batch):
    scores = load_predictor(f"{own_model}:Newest")(batch)
    assert torch.equal(scores.argmax(dim=1), batch.past[:, 0, -1].long())


def test_installed_entry_point_becomes_a_predictor(monkeypatch, batch):
    found = importlib.metadata.EntryPoint("newest", "semgrid_eval.models.baselines:RepeatNewest", ENTRY_POINT_GROUP)
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda *, group: importlib.metadata.EntryPoints([found]).select(group=group)
    )
    assert torch.equal(load_predictor("newest")(batch).argmax(dim=1), batch.past[:, 0, -1].long())
    with pytest.raises(InputError, match=r"no model 'oldest' is installed \(newest found\)"):
        load_predictor("oldest")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Missing", r"own_model\.py: defines no 'Missing'"),
        ("Broken", r"own_model\.py:Broken: raised ValueError: weights are missing"),
        ("constant", r"own_model\.py:constant: raised TypeError"),
        ("gives_text", r"own_model\.py:gives_text: gives an object that cannot be called"),
    ],
)
def test_model_that_cannot_be_made_is_named(own_model, name, message):
    with pytest.raises(InputError, match=message):
        load_predictor(f"{own_model}:{name}")


def test_file_that_is_missing_or_no_python_is_named(tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text("def half(")
    with pytest.raises(InputError, match=r"none\.py: is not a Python file"):
        load_predictor(f"{tmp_path / 'none.py'}:Model")
    with pytest.raises(InputError, match=r"broken\.py: raised SyntaxError"):
        load_predictor(f"{broken}:Model")


def raising(batch):
    raise KeyError("key")


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda batch: 3, "gave a int where a tensor is needed"),
        (lambda batch: torch.zeros(2, 8, 16, 16), r"scores 8 classes, and person, bicycle are missing"),
        (lambda batch: torch.zeros(2, 10, 16, 8), r"gave shape \(2, 10, 16, 8\) where \(2, 10, 16, 16\) is needed"),
        (lambda batch: torch.zeros(10, 16, 16), r"gave shape \(10, 16, 16\)"),
        (lambda batch: torch.zeros(2, 10, 16, 16, dtype=torch.int64), "floating-point type is needed"),
        (lambda batch: torch.full((2, 10, 16, 16), torch.nan), "NaN or infinite"),
        (raising, "raised KeyError: 'key'"),
    ],
)
def test_wrong_answers_are_one_line_that_names_the_model(batch, answer, message):
    with pytest.raises(InputError, match=message) as caught:
        CheckedPredictor(answer, "mine.py:Model")(batch)
    assert str(caught.value).startswith("mine.py:Model: ")
    assert "\n" not in str(caught.value)


def test_one_hot_is_certain_of_each_cells_class():
    classes = torch.arange(10, dtype=torch.uint8).reshape(1, 2, 5)
    scores = one_hot(classes)
    assert torch.equal(scores.argmax(dim=1), classes.long())
    assert torch.equal(scores.sum(dim=1), torch.ones(1, 2, 5))
