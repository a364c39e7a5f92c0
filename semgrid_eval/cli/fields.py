"""Options of a command from the fields of a configuration."""

from collections.abc import Iterator
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

import click
from pydantic.fields import FieldInfo

from semgrid_eval.cli.options import THERE
from semgrid_eval.config import Config


def parameters_of(config: type[Config]) -> Iterator[click.Parameter]:
    """Make an option for each field of a configuration, and an argument for a path, or paths, without default.

    Fields are numbers, words, paths, flags, `Literal` of words, tuples of a fixed length of such, or of any length
    (`tuple[str, ...]`: the option may be given several times). Limits are for the configuration to check.
    """
    for name, field in config.model_fields.items():
        kind = _plain(field.annotation)
        if kind is Path and field.is_required():
            yield click.Argument([name], type=THERE)
        elif kind == tuple[Path, ...] and field.is_required():
            yield click.Argument([name], type=THERE, nargs=-1, required=True)
        else:
            yield click.Option([f"--{name.replace('_', '-')}", name], **_settings(kind, field))


def _settings(kind: Any, field: FieldInfo) -> dict[str, Any]:  # noqa: ANN401 - a type
    settings = {"help": field.description, "required": field.is_required()}
    if kind is bool:
        return {**settings, "is_flag": True}
    if not field.is_required() and field.default is not None:
        settings |= {"default": field.default, "show_default": field.default != ()}
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        many = {"multiple": True} if Ellipsis in others else {"nargs": 1 + len(others)}
        return {**settings, **many, "type": _value_type(_plain(first))}
    return {**settings, "type": _value_type(kind)}


def _value_type(kind: Any) -> Any:  # noqa: ANN401 - types
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    return THERE if kind is Path else kind


def _plain(annotation: Any) -> Any:  # noqa: ANN401 - a type annotation
    """Take a type out of `Annotated` and `... | None`."""
    if get_origin(annotation) is Annotated:
        return _plain(get_args(annotation)[0])
    choices = [each for each in get_args(annotation) if each is not NoneType]
    return _plain(choices[0]) if NoneType in get_args(annotation) and len(choices) == 1 else annotation
