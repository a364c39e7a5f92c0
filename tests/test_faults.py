"""What is wrong with a value is said by what it has to be and what it is."""

import json
from typing import Annotated, Literal

import pytest
import yaml
from pydantic import Field

from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.faults import meant, not_one_of, shown, unknown_key, unreadable


class Settings(Config):
    count: int = Field(1, ge=0, le=1 << 53)
    share: float = Field(0.5, gt=0.0, lt=1.0)
    kind: Literal["row", "column"] = "row"
    only: Literal["one"] = "one"
    flag: bool = False
    name: Annotated[str, Field(min_length=1, max_length=3, pattern="^[a-z]*$")] = "a"
    pair: tuple[int, int] = (1, 2)
    by_name: dict[str, float] = Field(default_factory=lambda: {"a": 1.0}, min_length=1)


KEYS = "by_name, count, flag, kind, name, only, pair, share"


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"count": -1}, "count: must be at least 0, not -1"),
        ({"count": 1 << 54}, "count: must be at most 9007199254740992, not 18014398509481984"),
        ({"count": None}, "count: must be a whole number, not null"),
        ({"share": 0}, "share: must be above 0, not 0"),
        ({"share": 1}, "share: must be below 1, not 1"),
        ({"share": "half"}, "share: must be a number, not 'half'"),
        ({"kind": "colum"}, "kind: 'colum' is not one of row, column; did you mean column?"),
        ({"kind": True}, "kind: true is not one of row, column"),
        ({"only": "two"}, "only: 'two' is not one, the only choice"),
        ({"flag": "yes"}, "flag: must be true or false, not 'yes'"),
        ({"name": ""}, "name: must not be empty"),
        ({"name": "long"}, "name: must have at most 3 characters, not 4"),
        ({"name": "A"}, "name: must be text that matches ^[a-z]*$, not 'A'"),
        ({"pair": [1]}, "pair: entry 2 is missing"),
        ({"pair": [1, 2, 3]}, "pair: must have at most 2 entries, not 3"),
        ({"by_name": {}}, "by_name: must not be empty"),
        ({"by_name": {"a": []}}, "by_name.a: must be a number, not []"),
        (
            {"cuont": 3},
            f"cuont: unknown key; allowed here: {KEYS}; did you mean count?",
        ),
        ([], "must be a mapping of keys to values, not []"),
    ],
)
def test_a_fault_says_what_is_needed_and_what_is_found(change, line):
    with pytest.raises(ConfigError) as raised:
        parse_config(Settings, change)
    assert str(raised.value) == line


def test_what_is_near_is_proposed_and_nothing_else():
    assert meant("fues", ["fuse", "flow"]) == "; did you mean fuse?"
    assert meant("zebra", ["fuse", "flow"]) == ""
    assert not_one_of("a", []) == "'a' is not one of (there is none)"
    assert unknown_key("x", []) == "unknown key; allowed here: none"


def test_long_values_are_cut():
    assert shown("x" * 100) == f"'{'x' * 56}..."
    assert shown({"a": [True, None]}) == '{"a": [true, null]}'


def of(read, content):
    with pytest.raises((ValueError, RecursionError, yaml.YAMLError)) as raised:
        read(content)
    return unreadable(raised.value)


def test_parsers_are_quoted_in_words():
    assert of(json.loads, '{\n"a" 1}') == "line 2, column 5: expecting ':' delimiter"
    assert of(json.loads, b"\xff") == "the byte 0xff at place 0 is not UTF-8"
    assert of(json.loads, "[" * 100_000) == "it is nested too deeply"
    assert of(json.loads, "9" * 5000) == "a number has too many digits"
    assert of(yaml.safe_load, "a: [1") == "line 1: expected ',' or ']', but got the end of the file"
    assert of(yaml.safe_load, "a\x07") == r"the character '\x07' at place 1 is not allowed"
