from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from semgrid_eval.config import Config, load_yaml, parse_config, yaml_word
from semgrid_eval.errors import ConfigError


class Inner(Config):
    size: int = 1
    ratio: float = 0.5


class Outer(Config):
    inner: Inner = Inner()
    names: tuple[str, ...] = ()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"inner": {"sise": 2}}, "m.yaml: inner.sise: unknown key; allowed here: ratio, size"),
        ({"iner": {}}, "m.yaml: iner: unknown key; allowed here: inner, names"),
        ({"inner": {"size": "2"}}, "m.yaml: inner.size: must be a whole number, not '2'"),
        ({"inner": {"size": 2.5}}, "m.yaml: inner.size"),
        ({"names": "abc"}, "m.yaml: names"),
        ({"names": "abc", "iner": {}}, "m.yaml: iner: unknown key"),
        ([1, 2], "m.yaml: must be a mapping of keys to values"),
        ({"inner": {"ratio": float("nan")}}, "m.yaml"),
    ],
)
def test_a_fault_names_file_place_and_value(value, message):
    with pytest.raises(ConfigError, match=message):
        parse_config(Outer, value, path="m.yaml")


def test_lists_become_tuples_and_integers_floats():
    config = parse_config(Outer, {"names": ["a", "b"], "inner": {"ratio": 1}})
    assert config == Outer(names=("a", "b"), inner=Inner(ratio=1.0))


def test_plain_values_are_those_of_yaml_1_2(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("a: 1e-4\nb: off\nc: 2020-01-01\nd: 12\ne: true\nf: .5\ng: null\nh: 1.2.3")
    assert list(load_yaml(path).values()) == [1e-4, "off", "2020-01-01", 12, True, 0.5, None, "1.2.3"]
    path.write_text("a: 1:30\nb: 0o17\nc: 0x1F\nd: -7\ne: 1_000\nf: 0\ng: '010'\nh: 01.5\ni:\nj: 0b11")
    assert list(load_yaml(path).values()) == ["1:30", 15, 31, -7, "1_000", 0, "010", 1.5, None, "0b11"]


@example("1e5")
@example("true")
@example("/a: b")
@example("x" * 300 + " y")
@given(st.text(min_size=1))
def test_a_word_that_is_written_is_read_again_as_key_and_within_braces(word):
    written = yaml_word(word)
    assert written.isascii()
    assert "\n" not in written
    with TemporaryDirectory() as folder:
        path = Path(folder) / "m.yaml"
        path.write_text(f"{written}: # a key\n  inner: {{size: {written}, other: 1}}  # within braces\n")
        assert load_yaml(path) == {word: {"inner": {"size": word, "other": 1}}}


@pytest.mark.parametrize("word", ["/front/image_raw", "base_link", "off", "label-ids"])
def test_a_plain_word_is_written_as_it_is(word):
    assert yaml_word(word) == word


def test_a_merge_key_is_a_key_as_any_other(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("<<: {size: 1}")
    with pytest.raises(ConfigError, match="<<: unknown key; allowed here: inner, names"):
        parse_config(Outer, load_yaml(path), path=path)


def test_keys_that_are_no_words_are_refused():
    with pytest.raises(ConfigError, match="keys must be"):
        parse_config(Outer, {(1, 2): 3})
