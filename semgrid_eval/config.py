"""Strict, frozen configuration: an unknown key or impossible value is an error naming file, place and allowed keys."""

import json
import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from semgrid_eval.errors import ConfigError

_YAML_LIMIT_BYTES = 1 << 20


class Config(BaseModel):
    """Base of every configuration: frozen, strict, no unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


class _StrictLoader(yaml.SafeLoader):
    """YAML 1.2's plain values (`off` is a word, `1e-4` a number) and no aliases.

    An alias can make a short file expand beyond all memory.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias (*name) is not allowed here")
        return super().compose_node(parent, index)


_YAML_1_1_ONLY = ("tag:yaml.org,2002:bool", "tag:yaml.org,2002:float", "tag:yaml.org,2002:timestamp")
_StrictLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _YAML_1_1_ONLY]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:bool", re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), "tTfF"
)
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$"),
    "-+.0123456789",
)

C = TypeVar("C", bound=BaseModel)


def parse_config(model: type[C], value: object, *, path: Path | str | None = None) -> C:
    """Validate a plain value against a config class.

    Raises:
        ConfigError: names the place of the first fault, unknown keys before others, the value found there and, for a
            key, the allowed ones.
    """
    try:
        # JSON is the strict border: it allows lists for tuples and names for enums, and nothing else that YAML guesses.
        return model.model_validate_json(json.dumps(value, default=str))
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
        if path.stat().st_size > _YAML_LIMIT_BYTES:
            raise ConfigError("is larger than 1 MiB, which no configuration needs", path=path)
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_StrictLoader)
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror or error}", path=path) from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError(f"is not valid YAML: {error}", path=path) from error


def _first_fault(model: type[BaseModel], error: ValidationError, path: Path | str | None) -> ConfigError:
    faults = error.errors(include_url=False)
    # A misspelt key is also a missing one, and says more.
    fault = next((each for each in faults if each["type"] == "extra_forbidden"), faults[0])
    place = ".".join(str(part) for part in fault["loc"]) or "(top level)"
    message = fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        allowed = ", ".join(_allowed_keys(model, fault["loc"][:-1])) or "none"
        return ConfigError(f"unknown key; allowed here: {allowed}", path=path, field=place)
    shown = repr(fault.get("input"))
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    return ConfigError(f"{message} (found {shown})", path=path, field=place)


def _allowed_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
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
