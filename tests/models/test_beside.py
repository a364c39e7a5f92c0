"""What lies beside a model's file: found by its code alone, and part of what the file is made of."""

import importlib
import sys

import pytest

from semgrid_eval.models.beside import ModelFile

MODEL = """
import helper
import package.part
import json.tool

def told():
    import helper as again
    return helper.WORD + package.part.WORD + again.WORD

def late():
    import other
"""


def write(folder, word):
    (folder / "package").mkdir(parents=True)
    (folder / "helper.py").write_text(f"WORD = {word!r}\n")
    (folder / "package" / "part.py").write_text("import helper\nWORD = helper.WORD.upper()\n")
    (folder / "other.py").write_text("")
    (folder / "model.py").write_text(MODEL)
    return folder / "model.py"


def test_files_of_two_folders_each_get_their_own_neighbours(tmp_path):
    files = [ModelFile(write(tmp_path / word, word)) for word in ("a", "b")]
    modules = [file.load() for file in files]
    for file, module, told in zip(files, modules, ("aAa", "bBb"), strict=True):
        with file.present(), file.present():
            assert module.told() == told
    assert modules[0].__name__ != modules[1].__name__


def test_nothing_of_it_stays_behind(tmp_path):
    path, modules = list(sys.path), set(sys.modules)
    file = ModelFile(write(tmp_path, "a"))
    module = file.load()
    with file.present():
        assert {"helper", "package", "package.part"} <= set(sys.modules)
    assert sys.path == path
    assert {name for name in set(sys.modules) - modules if not name.startswith("json")} == {module.__name__}
    (tmp_path / "model.py").write_text("import helper\nraise ValueError\n")
    with pytest.raises(ValueError):  # noqa: PT011 - raised above
        ModelFile(tmp_path / "model.py").load()
    assert sys.path == path
    assert "helper" not in sys.modules


def test_module_of_the_same_name_from_elsewhere_comes_back(tmp_path, monkeypatch):
    file = ModelFile(write(tmp_path, "a"))
    module = file.load()
    elsewhere = object()
    monkeypatch.setitem(sys.modules, "helper", elsewhere)
    with file.present():
        assert module.told() == "aAa"
    assert sys.modules["helper"] is elsewhere


def test_sources_are_the_file_and_what_it_has_imported_from_beside_it(tmp_path):
    file = ModelFile(write(tmp_path, "a"))
    file.load()
    assert file.sources() == [tmp_path / name for name in ("model.py", "helper.py", "package/part.py")]
    assert file.is_current()
    (tmp_path / "other.py").write_text("changed")
    assert file.is_current()
    (tmp_path / "helper.py").write_text("changed")
    assert not file.is_current()
    (tmp_path / "helper.py").unlink()
    assert not file.is_current()


def test_a_neighbour_that_the_caller_has_imported_is_a_source_too(tmp_path, monkeypatch):
    path = write(tmp_path, "a")
    monkeypatch.syspath_prepend(tmp_path)
    helper = importlib.import_module("helper")
    file = ModelFile(path)
    file.load()
    assert tmp_path / "helper.py" in file.sources()
    assert sys.modules["helper"] is helper
    del sys.modules["helper"]


def test_what_was_not_imported_at_first_cannot_be_imported_later(tmp_path):
    file = ModelFile(write(tmp_path, "a"))
    module = file.load()
    with file.present(), pytest.raises(ModuleNotFoundError):
        module.late()


def test_packages_of_an_environment_below_the_folder_are_not_neighbours(tmp_path, monkeypatch):
    site = tmp_path / ".venv" / "site-packages"
    site.mkdir(parents=True)
    (site / "installed_there.py").write_text("")
    (tmp_path / "model.py").write_text("import installed_there\n")
    monkeypatch.syspath_prepend(site)
    file = ModelFile(tmp_path / "model.py")
    file.load()
    assert file.sources() == [tmp_path / "model.py"]
    assert sys.modules.pop("installed_there")
