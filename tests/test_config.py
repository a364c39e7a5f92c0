import pytest

from semgrid_eval.config import Config, load_yaml, parse_config
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
        ({"inner": {"size": "2"}}, r"m.yaml: inner.size: .*integer.* \(found '2'\)"),
        ({"inner": {"size": 2.5}}, "m.yaml: inner.size"),
        ({"names": "abc"}, "m.yaml: names"),
        ({"names": "abc", "iner": {}}, "m.yaml: iner: unknown key"),
        ([1, 2], r"m.yaml: \(top level\)"),
        ({"inner": {"ratio": float("nan")}}, "m.yaml"),
    ],
)
def test_a_fault_names_file_place_and_value(value, message):
    with pytest.raises(ConfigError, match=message):
        parse_config(Outer, value, path="m.yaml")


def test_lists_become_tuples_and_integers_floats():
    config = parse_config(Outer, {"names": ["a", "b"], "inner": {"ratio": 1}})
    assert config == Outer(names=("a", "b"), inner=Inner(ratio=1.0))


def test_yaml_that_would_build_objects_is_refused(tmp_path):
    path = tmp_path / "evil.yaml"
    path.write_text("!!python/object/apply:os.system ['true']")
    with pytest.raises(ConfigError, match=r"evil\.yaml: is not valid YAML"):
        load_yaml(path)
    path.write_text("a: [1, 2")
    with pytest.raises(ConfigError, match=r"evil\.yaml: is not valid YAML"):
        load_yaml(path)


def test_plain_values_are_those_of_yaml_1_2(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("a: 1e-4\nb: off\nc: 2020-01-01\nd: 12\ne: true\nf: .5\ng: null\nh: 1.2.3")
    assert list(load_yaml(path).values()) == [1e-4, "off", "2020-01-01", 12, True, 0.5, None, "1.2.3"]
    path.write_text("a: 1:30\nb: 0o17\nc: 0x1F\nd: -7\ne: 1_000\nf: 0\ng: '010'\nh: 01.5\ni:\nj: 0b11")
    assert list(load_yaml(path).values()) == ["1:30", 15, 31, -7, "1_000", 0, "010", 1.5, None, "0b11"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seed: 1\nrows: 2\nseed: 3", "line 3: the key 'seed' stands in line 1 already"),
        ("a: {b: 1, b: 2}", "line 1: the key 'b' stands in line 1 already"),
        ("a:\n  - b: 1\n    'b': 2", "line 3: the key 'b' stands in line 2 already"),
        ("a: 1\nb: 010", "line 2: 010 is ambiguous: write it without the leading 0, or in quotes"),
        ("2019: 1", "line 1: the key '2019' is not a word; put it in quotes"),
        ("null: 2", "line 1: the key 'null' is not a word; put it in quotes"),
        ("? [a]\n: 2", "line 1: the key here is not a word; put it in quotes"),
        ("a: &x 1\n<<: *x", "line 2: an alias (*name) is not allowed here"),
        ("a: !!int 'x'", "line 1: a tag (tag:yaml.org,2002:int) is not allowed here"),
        ("a:\n  - [1, 2", "line 2: expected ',' or ']', but got '<stream end>'"),
    ],
)
def test_a_fault_of_yaml_is_one_line_that_names_the_line(tmp_path, text, message):
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as raised:
        load_yaml(path)
    assert str(raised.value) == f"{path}: is not valid YAML: {message}"


def test_a_merge_key_is_a_key_as_any_other(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("<<: {size: 1}")
    with pytest.raises(ConfigError, match="<<: unknown key; allowed here: inner, names"):
        parse_config(Outer, load_yaml(path), path=path)


def test_a_number_beyond_all_bounds_is_refused(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("a: " + 9999 * "9")
    with pytest.raises(ConfigError, match=r"m\.yaml: is not valid YAML: line 1: 9{20}\.\.\. is larger than any number"):
        load_yaml(path)


def test_aliases_that_could_fill_all_memory_are_refused(tmp_path):
    path = tmp_path / "bomb.yaml"
    path.write_text("a: &a [1, 2]\nb: [*a, *a]")
    with pytest.raises(ConfigError, match=r"bomb\.yaml: is not valid YAML: line 2: an alias"):
        load_yaml(path)


def test_keys_that_are_no_words_are_refused():
    with pytest.raises(ConfigError, match="keys must be"):
        parse_config(Outer, {(1, 2): 3})
