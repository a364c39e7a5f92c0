"""Models of one's own: found by file or entry point, and every fault of their code told in one line."""

import importlib.metadata

import pytest
import torch
from support.models import made, network
from support.planned import planned
from support.recordings import random_recording

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.models.model import Model, require_scores
from semgrid_eval.models.network import Network
from semgrid_eval.models.registry import ENTRY_POINT_GROUP, find_model, is_named, own_models, version_of
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings

OWN_MODELS = """
import torch
from pydantic import field_validator
from semgrid_eval.config import Config
from semgrid_eval.models.model import Model, one_hot
from semgrid_eval.models.network import Network, input_planes

class Newest(Model, torch.nn.Module):
    class Settings(Config):
        scale: float = 1.0

    def predict(self, batch):
        return one_hot(batch.past[:, 0, -1]) * self.settings.scale

class Small(Network):
    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.layer = torch.nn.Conv2d(given.planes, 10, 1)

    def forward(self, batch):
        batch.shift_cells.zero_()
        return self.layer(input_planes(batch.past))

class Unprepared(Network):
    def prepare(self, windows):
        return {}["prior"]

class Counted(Model):
    '''Counts classes, cell by cell.

    More of it.
    '''

    family = "BL"
    files = ("table.txt",)

    def fit(self, windows):
        raise OSError("no\\nroom")

class Broken(Model):
    def __init__(self, settings, given):
        raise ValueError("weights are\\nmissing")

class Silent(Model):
    @classmethod
    def check(cls, settings, given):
        settings.unheard_of

class Looking(Model):
    class Settings(Config):
        table: str = "small"

        @field_validator("table")
        @classmethod
        def _known(cls, table):
            return {"small": table}[table]

class Untyped(Model):
    class Settings:
        pass

class Untrained(Network):
    class Settings(Config):
        pass

class Listed(Model):
    files = ["table.txt"]

class Maybe(Model):
    baseline = "no"

constant = 7
class Alone:
    pass
"""


@pytest.fixture(autouse=True)
def here():
    """Models run in this process."""
    with own_models(None):
        yield


@pytest.fixture
def batch():
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    return select_windows(data, planned((0, (0, 5), 10), (0, (1, 6), 11)), sensors=["full"]).batch(slice(None))


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own_models.py"
    path.write_text(OWN_MODELS)
    return path


def test_class_in_a_file_is_a_model_with_its_settings(own, batch):
    model = made(find_model(f"{own}:Newest"), scale=0.5)
    assert torch.equal(model.predict(batch).argmax(dim=1), batch.past[:, 0, -1].long())
    assert model.predict(batch).max() == 0.5


def test_what_a_class_says_of_itself_is_seen(own):
    newest, small, counted = (find_model(f"{own}:{name}") for name in ("Newest", "Small", "Counted"))
    assert [model.family for model in (newest, small, counted)] == ["Newest", "Small", "BL"]
    assert [model.learns() for model in (newest, small, counted)] == [False, True, True]
    assert [model.random for model in (newest, small, counted)] == [False, True, False]
    assert [model.files for model in (newest, small, counted)] == [None, (), ("table.txt",)]
    assert newest.in_words(newest.Settings()) == "Newest"
    assert counted.in_words(counted.Settings()) == "Counts classes, cell by cell"


def test_a_network_cannot_change_what_others_see(own, batch):
    shifts = batch.shift_cells.clone()
    assert shifts.any()
    net = network(find_model(f"{own}:Small"))
    assert isinstance(net, Network)
    assert net(batch).shape == (2, 10, 16, 16)
    assert torch.equal(batch.shift_cells, shifts)


def test_installed_entry_point_is_a_model(monkeypatch, batch):
    found = importlib.metadata.EntryPoint("mine", "semgrid_eval.models.newest:RepeatNewest", ENTRY_POINT_GROUP)
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda *, group: importlib.metadata.EntryPoints([found]).select(group=group)
    )
    model = made(find_model("mine"))
    assert torch.equal(model.predict(batch).argmax(dim=1), batch.past[:, 0, -1].long())
    assert is_named("mine")
    assert version_of("mine") != version_of("newest")
    with pytest.raises(InputError, match=r"model: 'yours' is not one of .*, mine, path.py:Class"):
        find_model("yours")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Missing", r"own_models\.py: defines no 'Missing'"),
        ("constant", r"own_models\.py:constant: is not a class that has `Model` or `Network` as its base"),
        ("Alone", r"own_models\.py:Alone: is not a class that has `Model` or `Network` as its base"),
        ("Untyped", r"own_models\.py:Untyped: has `Settings` that do not have `Config` as their base"),
        ("Listed", r"own_models\.py:Listed: files: must be of type tuple \| None, not \['table\.txt'\]"),
        ("Maybe", r"own_models\.py:Maybe: baseline: must be of type bool, not 'no'"),
        ("Untrained", r"own_models\.py:Untrained: has `Settings` that do not have `NetworkSettings` as their base"),
    ],
)
def test_what_is_no_model_is_named(own, name, message):
    with pytest.raises(InputError, match=message):
        find_model(f"{own}:{name}")


def test_validator_that_raises_is_named(own):
    looking = find_model(f"{own}:Looking")
    assert looking.parse_settings({}).table == "small"
    with pytest.raises(InputError, match=r"own_models\.py:Looking: raised KeyError: 'large'$"):
        looking.parse_settings({"table": "large"})


def test_model_that_cannot_be_made_or_fitted_is_named(own, batch):
    with pytest.raises(InputError, match=r"own_models\.py:Broken: raised ValueError: weights are missing"):
        made(find_model(f"{own}:Broken"))
    with pytest.raises(InputError, match=r"own_models\.py:Counted: raised OSError: no room"):
        made(find_model(f"{own}:Counted")).fit(None)
    with pytest.raises(InputError, match=r"own_models\.py:Silent: raised NotImplementedError: Silent has no `predict`"):
        made(find_model(f"{own}:Silent")).predict(batch)
    with pytest.raises(InputError, match=r"own_models\.py:Silent: raised AttributeError: .*unheard_of"):
        find_model(f"{own}:Silent").check(Config(), None)


def test_network_that_cannot_be_prepared_is_named(own):
    with pytest.raises(InputError, match=r"own_models\.py:Unprepared: raised KeyError: 'prior'$"):
        network(find_model(f"{own}:Unprepared")).prepare(None)


def test_a_declared_file_that_is_missing_is_named_and_another_is_another_version(own):
    spec = f"{own}:Counted"
    with pytest.raises(InputError, match=r"own_models\.py:Counted: files: declares the file table\.txt, which is not"):
        version_of(spec)
    versions = []
    for text in ("a", "b", "a"):
        (own.parent / "table.txt").write_text(text)
        versions.append(version_of(spec))
    assert versions[0] == versions[2] != versions[1]


def test_file_that_is_missing_or_no_python_is_named(tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text("def half(")
    with pytest.raises(InputError, match=r"none\.py: is not there"):
        find_model(f"{tmp_path / 'none.py'}:Model")
    with pytest.raises(InputError, match=r"broken\.py: raised SyntaxError"):
        find_model(f"{broken}:Model")
    broken.write_text("raise SystemExit(3)")
    with pytest.raises(InputError, match=r"broken\.py: raised SystemExit: 3"):
        find_model(f"{broken}:Model")


def raising(batch):
    raise KeyError("key")


def leaving(batch):
    raise GeneratorExit


def guarded(tmp_path, base, answer):
    """A model of that base from a file, whose answers are these."""
    path = tmp_path / "own.py"
    method = "predict" if base == "Model" else "forward"
    path.write_text(
        "from semgrid_eval.models.model import Model\nfrom semgrid_eval.models.network import Network\n"
        f"class Own({base}):\n    def {method}(self, batch):\n        return self.answer(batch)\n"
    )
    model = find_model(f"{path}:Own")
    model.answer = staticmethod(answer)
    return made(model)


@pytest.mark.parametrize("base", ["Model", "Network"])
@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda batch: 3, "gave int where a tensor is needed"),
        (lambda batch: torch.zeros(2, 8, 16, 16), r"scores 8 classes, and person, bicycle are missing"),
        (lambda batch: torch.zeros(2, 10, 16, 8), r"gave shape \(2, 10, 16, 8\) where \(2, 10, 16, 16\) is needed"),
        (lambda batch: torch.zeros(10, 16, 16), r"gave shape \(10, 16, 16\)"),
        (lambda batch: torch.zeros(2, 10, 16, 16, dtype=torch.int64), "floating-point type is needed"),
        (lambda batch: torch.full((2, 10, 16, 16), torch.nan), "NaN or infinite"),
        (raising, "raised KeyError: 'key'"),
        (leaving, "raised GeneratorExit"),
    ],
)
def test_wrong_answers_are_one_line_that_names_the_model(tmp_path, batch, base, answer, message):
    model = guarded(tmp_path, base, answer)
    with pytest.raises(InputError, match=message) as caught:
        require_scores(model.predict(batch), batch, model)
    assert str(caught.value).startswith(f"{tmp_path}/own.py:Own: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("base", ["Model", "Network"])
def test_a_lack_of_memory_stays_what_it_is(tmp_path, batch, base):
    def too_large(batch):
        raise torch.OutOfMemoryError("CUDA out of memory")

    with pytest.raises(torch.OutOfMemoryError):
        guarded(tmp_path, base, too_large).predict(batch)


def test_a_loss_that_is_no_number_is_named(tmp_path, batch):
    net = guarded(tmp_path, "Network", lambda batch: torch.zeros(2, 10, 16, 16))
    type(net).__mro__[3].loss = lambda self, logits, batch: logits
    with pytest.raises(InputError, match=r"own\.py:Own: gave a loss that is not a tensor of one number"):
        net.loss(net(batch), batch)


def test_one_hot_and_base_say_nothing_of_what_they_do_not_know():
    assert not Model.learns()
    assert Model.files is None
