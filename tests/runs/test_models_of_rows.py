"""The models that rows of a matrix name, and their settings."""

import importlib.metadata
from pathlib import Path

import pytest
from support.matrices import load, write

from semgrid_eval.errors import ConfigError
from semgrid_eval.models.registry import ENTRY_POINT_GROUP
from semgrid_eval.runs.matrix import load_matrix


@pytest.mark.slow
def test_models_of_ones_own_are_rows_with_the_matrix_s_defaults(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lib").mkdir()
    Path("mine.py").write_text("class Other:\n    raise RuntimeError('run')\n")
    Path("lib/mine.py").write_text("from beside import Unknown as Mine\n")
    write(tmp_path, mine={"defaults": {"mask_mode": "off"}, "rows": [{"name": "a", "model": "newest"}]})
    rows = load_matrix(str(tmp_path / "mine.yaml"), models=["lib/mine.py:Mine", "mine.py:Other"]).rows
    assert [(row.name, row.model, row.facts.family, row.mask_mode) for row in rows[1:]] == [
        ("Mine", "lib/mine.py:Mine", "Mine", "off"),
        ("Other", "mine.py:Other", "Other", "off"),
    ]
    with pytest.raises(ConfigError, match="'de' is not one of"):
        load_matrix("smoke", models=["de"])


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("class Other:\n    Mine = 3\n    def Mein(self): return 'Nope'\n", r"mine\.py: defines no 'Nope'"),
        ("def half(", r"mine\.py: is not Python code: .*line 1"),
        ("\0", r"mine\.py: is not Python code: "),
    ],
)
def test_a_class_that_a_file_cannot_have_is_told_at_once(tmp_path, code, fault):
    (tmp_path / "mine.py").write_text(code)
    with pytest.raises(ConfigError, match=rf"^model: .*{fault}"):
        load_matrix("smoke", models=[f"{tmp_path}/mine.py:Nope"])


@pytest.mark.parametrize(
    "code",
    ["if 1:\n    Nope = 3", "from x import *", "import x as Nope", "globals()['No' + 'pe'] = 3"],
)
def test_a_class_that_a_file_may_make_is_left_to_its_row(tmp_path, code):
    (tmp_path / "mine.py").write_text(code)
    assert load_matrix("smoke", models=[f"{tmp_path}/mine.py:Nope"]).rows[-1].name == "Nope"


@pytest.mark.slow
def test_an_installed_model_is_a_row_and_is_looked_for_only_where_one_is_asked_for(tmp_path, monkeypatch):
    looked_for = []

    def entry_points(*, group):
        looked_for.append(group)
        return importlib.metadata.EntryPoints([importlib.metadata.EntryPoint("mine", "package:Mine", group)])

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    (tmp_path / "mine.py").write_text("class Mine: pass\n")
    load_matrix("paper", models=[f"{tmp_path}/mine.py:Mine"])
    assert looked_for == []
    assert load(tmp_path, {"rows": [{"name": "a", "model": "mine"}]}).rows[0].model == "mine"
    assert set(looked_for) == {ENTRY_POINT_GROUP}
    with pytest.raises(ConfigError, match=r"'yours' is not one of ed, .*, mine, path\.py:Class"):
        load(tmp_path, {"rows": [{"name": "a", "model": "yours"}]})


def test_settings_of_a_model_lie_under_those_of_its_rows_alone(tmp_path):
    row = {"name": "{model}-{settings.depth}", "axes": {"zip": {"model": ["ed", "ed"], "settings.depth": [2, 4]}}}
    rows = [row, {"name": "f", "model": "ed", "settings": {"features": 8}}, {"name": "n", "model": "newest"}]
    matrix = load(tmp_path, {"models": {"ed": {"features": 4, "depth": 5}}, "rows": rows})
    told = {row.name: (row.settings.get("depth"), row.settings.get("features")) for row in matrix.rows}
    assert told == {"ed-2": (2, 4), "ed-4": (4, 4), "f": (5, 8), "n": (None, None)}


def test_settings_of_what_is_no_model_are_an_error(tmp_path):
    with pytest.raises(ConfigError, match=r"m\.yaml: models: 'edd' is not one of ed, .*did you mean ed\?"):
        load(tmp_path, {"models": {"edd": {}}, "rows": [{"name": "a", "model": "newest"}]})


OWN = """
from pydantic import field_validator
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.network import Network, NetworkSettings

class Own(Network):
    words = "an own network"

    class Settings(NetworkSettings):
        width: int = 3

        @field_validator("width")
        @classmethod
        def _looked_up(cls, width):
            return {3: 3, 4: 4, 8: 8, 999: 999}[width]

    @classmethod
    def check(cls, settings, given):
        if settings.width > given.columns:
            raise ConfigError("is too wide", field="settings.width")
"""


@pytest.mark.slow
def test_settings_of_ones_own_network_are_axes_and_checked_where_its_code_can_be_loaded(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    model = f"{tmp_path}/own.py:Own"
    row = {"name": "w{settings.width}", "model": model, "repeats": 2, "axes": {"grid": {"settings.width": [4, 8]}}}
    rows = load(tmp_path, {"models": {model: {"training": {"epochs": 2}}}, "rows": [row]}).rows
    assert [(row.settings["width"], row.settings["training"]["epochs"]) for row in rows] == [(4, 2), (8, 2)]
    assert rows[0].settings["training"]["batch"] == 32
    assert rows[0].label.startswith("w4 (an own network, moved to the target's time")
    assert (rows[0].facts.family, rows[0].facts.learns, rows[0].facts.baseline) == ("Own", True, False)
    faults = (
        ({"widht": 4}, r"settings\.widht: unknown key"),
        ({"width": 999}, "width: is too wide"),
        ({"width": 5}, r"own\.py:Own: raised KeyError: 5$"),
    )
    for settings, message in faults:
        with pytest.raises(ConfigError, match=rf"m\.yaml: row 'a': .*{message}"):
            load(tmp_path, {"rows": [{"name": "a", "model": model, "settings": settings}]})
    (tmp_path / "own.py").write_text("def half(")
    row = load(tmp_path, {"rows": [{"name": "a", "model": model, "settings": {"widht": 4}}]}).rows[0]
    assert (row.settings, row.facts.family, row.facts.learns) == ({"widht": 4}, "Own", False)


def test_facts_are_what_the_model_says(tmp_path):
    rows = [{"name": name, "model": name} for name in ("ed", "newest", "table", "fuse", "flow")]
    facts = {row.name: row.facts for row in load(tmp_path, {"rows": rows}).rows}
    assert {name: (fact.family, fact.learns, fact.baseline) for name, fact in facts.items()} == {
        "ed": ("ED", True, False),
        "newest": ("BL", False, True),
        "table": ("BL", True, True),
        "fuse": ("BL", False, True),
        "flow": ("BL", False, True),
    }
