"""Strict, frozen configuration: an unknown key or impossible value is an error naming file, place and allowed keys."""

import json
import math
import re
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.faults import in_words, not_one_of, unknown_key, unreadable
from semgrid_eval.files import read_bytes

_YAML_LIMIT_BYTES = 1 << 20
_LONGEST_NUMBER = 40  # characters
_SHOWN = 20
_UNKNOWN = "extra_forbidden"


class Config(BaseModel):
    """Base of every configuration: frozen, strict, no unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


def merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Put `change` over `base`, mapping by mapping."""
    result = dict(base)
    for key, value in change.items():
        old = result.get(key)
        result[key] = merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result


class _StrictLoader(yaml.SafeLoader):
    """The plain values of YAML 1.2's core schema (`off` is a word, `1e-4` a number), and nothing ambiguous.

    There are no tags, and no aliases, since one can make a short file expand beyond all memory. Keys are words, each
    once in a mapping. A whole number that begins with 0 is refused: YAML 1.1 reads `010` as 8, YAML 1.2 as 10.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _at(event, "an alias (*name) is not allowed here")
        if event.tag is not None:
            raise _at(event, f"a tag ({event.tag}) is not allowed here")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if key.tag != _tag("str"):
                shown = repr(key.value) if isinstance(key, yaml.ScalarNode) else "here"
                raise _at(key, f"the key {shown} is not a word; put it in quotes")
            if key.value in seen:
                raise _at(key, f"the key {key.value!r} stands in line {seen[key.value]} already")
            seen[key.value] = _line(key)
        return super().construct_mapping(node, deep)

    def construct_int(self, node: yaml.ScalarNode) -> int:
        """Read a whole number: decimal, `0o17` or `0x1f`."""
        if re.match(r"[-+]?0[0-9]", node.value):
            raise _at(node, f"{node.value[:_SHOWN]} is ambiguous: write it without the leading 0, or in quotes")
        if len(node.value) > _LONGEST_NUMBER:
            raise _at(node, f"{node.value[:_SHOWN]}... is larger than any number that is needed")
        return int(node.value, 0)


def _tag(name: str) -> str:
    return f"tag:yaml.org,2002:{name}"


def _line(place: yaml.Node | yaml.Event) -> int:
    assert place.start_mark is not None, "what is read from a file stands in a line"
    return place.start_mark.line + 1


def _at(place: yaml.Node | yaml.Event, message: str) -> yaml.YAMLError:
    return yaml.YAMLError(f"line {_line(place)}: {message}")


_StrictLoader.yaml_implicit_resolvers = {}
for _name, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", "-+.0123456789"),
    ("null", r"null|Null|NULL|~|", ["n", "N", "~", ""]),
):
    _StrictLoader.add_implicit_resolver(_tag(_name), re.compile(f"^({_pattern})$"), _first)
_StrictLoader.add_constructor(_tag("int"), _StrictLoader.construct_int)


class _StrictDumper(yaml.SafeDumper):
    """Quotes the words that `_StrictLoader` takes for something else."""

    yaml_implicit_resolvers = _StrictLoader.yaml_implicit_resolvers


C = TypeVar("C", bound=BaseModel)


def strictly(model: type[C], value: object) -> C:
    """Validate a plain value; what is wrong with it is raised as pydantic does.

    JSON is the strict border: it allows lists for tuples and names for enums, and nothing else that YAML guesses.
    """
    return model.model_validate_json(json.dumps(value, default=str))


def of_kind(value: object, kinds: Mapping[str, type[BaseModel]], default: str | None = None) -> object:
    """Validate a mapping against the class that its key `kind` names, or `default` where it has none.

    For a field of which several classes are possible; what is not a mapping is left for pydantic to judge.
    """
    if not isinstance(value, Mapping):
        return value
    kind = value.get("kind", default)
    if kind is None:
        raise ValueError(f"kind: is missing; it is one of {', '.join(kinds)}")
    if kind not in tuple(kinds):
        raise ValueError(f"kind: {not_one_of(kind, kinds)}")
    config = kinds[kind]
    if unknown := [key for key in value if key not in config.model_fields]:
        raise ValueError(f"{unknown[0]}: {unknown_key(unknown[0], sorted(config.model_fields))}")
    return strictly(config, value)


def parse_config(model: type[C], value: object, *, path: Path | str | None = None) -> C:
    """Validate a plain value against a config class.

    Raises:
        ConfigError: names the place of the first fault, unknown keys before others, the value found there and, for a
            key, the allowed ones.
    """
    try:
        return strictly(model, value)
    except ValidationError as error:
        raise _first_fault(model, error, path) from None
    except (ValueError, TypeError) as error:
        raise ConfigError(str(error), path=path) from None


def load_yaml(path: Path) -> Any:  # noqa: ANN401 - anything that YAML can hold
    """Read a YAML file safely (no tags that build objects, at most 1 MiB).

    Raises:
        ConfigError: the file cannot be read or is not YAML.
    """
    try:
        content = read_bytes(path, limit=_YAML_LIMIT_BYTES)
    except InputError as error:
        raise ConfigError(str(error).removeprefix(f"{path}: "), path=path) from error
    try:
        return yaml.load(content.decode(), Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: not UTF-8, or a number of 5,000 digits
        raise ConfigError(f"is not valid YAML: {unreadable(error)}", path=path) from error


def yaml_word(word: str) -> str:
    """Write a word in ASCII as `load_yaml` reads it anywhere, within braces too: in quotes where it needs them."""
    listed: str = yaml.dump([word], Dumper=_StrictDumper, default_flow_style=True, width=math.inf)
    return listed.removeprefix("[").removesuffix("]\n")


def _first_fault(model: type[BaseModel], error: ValidationError, path: Path | str | None) -> ConfigError:
    faults = error.errors(include_url=False)
    # A misspelt key is also a missing one, and says more.
    fault = next((each for each in faults if each["type"] == _UNKNOWN), faults[0])
    *above, last = fault["loc"] or ("",)
    if fault["type"] == _UNKNOWN:
        return ConfigError(unknown_key(str(last), _allowed_keys(model, above)), path=path, field=_place(fault["loc"]))
    if fault["type"] == "missing" and isinstance(last, int):  # of a list with a fixed number of entries
        return ConfigError(f"entry {last + 1} is missing", path=path, field=_place(above))
    return ConfigError(in_words(fault), path=path, field=_place(fault["loc"]))


def _place(location: Iterable[int | str]) -> str | None:
    return ".".join(str(part) for part in location if part != "[key]") or None


def _allowed_keys(model: type[BaseModel], location: Iterable[int | str]) -> list[str]:
    """Walk down the config classes along `location` as far as their annotations tell."""
    current: type[BaseModel] | None = model
    for part in location:
        if current is not None and part in current.model_fields:
            current = _config_class(current.model_fields[str(part)].annotation) or current
    return sorted(current.model_fields) if current is not None else []


def _config_class(annotation: Any) -> type[BaseModel] | None:  # noqa: ANN401 - a type annotation
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in getattr(annotation, "__args__", ()):
        found = _config_class(part)
        if found is not None:
            return found
    return None
