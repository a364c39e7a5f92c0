"""What is wrong with a value, in one line that says what would be right."""

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import yaml

_SHOWN = 60
_NEEDED = {
    "greater_than_equal": "at least {ge}",
    "greater_than": "above {gt}",
    "less_than_equal": "at most {le}",
    "less_than": "below {lt}",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of fewer digits",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "path_type": "a path",
    "string_pattern_mismatch": "text that matches {pattern}",
}
"""What a value has to be, by pydantic's name of what it is not."""
_LENGTHS = {
    "too_short": ("at least {min_length}", "entries"),
    "too_long": ("at most {max_length}", "entries"),
    "string_too_short": ("at least {min_length}", "characters"),
    "string_too_long": ("at most {max_length}", "characters"),
}
_PARTS = {
    "stream end": "the end of the file",
    "block end": "the end of this block",
    "block mapping start": "another one, of other indentation",
    "scalar": "a second value",
}
"""What PyYAML's words mean to who has written a file."""
_CHOICES = ("literal_error", "enum")


def not_one_of(value: object, names: Iterable[str]) -> str:
    """Say that a value is none of these names, and which of them may have been meant."""
    known = list(names)
    if len(known) == 1:
        return f"{shown(value)} is not {known[0]}, the only choice"
    return f"{shown(value)} is not one of {', '.join(known) or '(there is none)'}{meant(value, known)}"


def meant(value: object, names: Iterable[str]) -> str:
    """Ask, at the end of a line, whether the name that is nearest to a value was meant; nothing if none is near."""
    near = difflib.get_close_matches(str(value), list(names), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def unknown_key(key: str, allowed: Iterable[str]) -> str:
    """Say that a key is unknown, and which there are."""
    known = list(allowed)
    return f"unknown key; allowed here: {', '.join(known) or 'none'}{meant(key, known)}"


def shown(value: object) -> str:
    """Write a value as a file would have it, cut if it is long."""
    text = repr(value) if isinstance(value, str) else json.dumps(value, default=str)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def unreadable(error: Exception) -> str:
    """Say what of a text is neither YAML nor JSON, and in which line."""
    if isinstance(error, UnicodeDecodeError):
        return f"the byte 0x{error.object[error.start]:02x} at place {error.start} is not UTF-8"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, json.JSONDecodeError):
        return f"line {error.lineno}, column {error.colno}: {error.msg[0].lower()}{error.msg[1:]}"
    if isinstance(error, yaml.reader.ReaderError):
        return f"the character {chr(error.character)!a} at place {error.position} is not allowed"
    if isinstance(error, yaml.MarkedYAMLError):
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        return line + re.sub(r"'?<([a-z ]+)>'?", lambda found: _PARTS.get(found[1], found[1]), str(error.problem))
    return "a number has too many digits" if "integer string" in str(error) else str(error)


def in_words(fault: Mapping[str, Any]) -> str:
    """Put what pydantic says of a value into words: what it has to be, and what it is."""
    kind, found = fault["type"], fault.get("input")
    context = {name: f"{each:.15g}" if isinstance(each, float) else each for name, each in fault.get("ctx", {}).items()}
    if kind == "missing":
        return "is missing"
    if kind in _CHOICES:
        return not_one_of(found, re.findall(r"[^', ]+", context["expected"].replace(" or ", ", ")))
    if kind in _NEEDED:
        return f"must be {_NEEDED[kind].format(**context)}, not {shown(found)}"
    if kind in _LENGTHS:
        limit, things = _LENGTHS[kind]
        size = len(found) if isinstance(found, str | list | dict) else context.get("actual_length")
        return f"must have {limit.format(**context)} {things}, not {size}" if size else "must not be empty"
    if kind == "value_error":  # of ours
        return str(fault["msg"]).removeprefix("Value error, ")
    return f"{fault['msg']} (found {shown(found)})"
