"""JSON that is changed here and there."""

import json
from typing import Any

import yaml

from semgrid_eval.config import merged

GONE = "(gone)"
BROKEN = {
    "nothing": b"",
    "an object that does not end": b'{"speed": 5.5',
    "a list": b"[1, 2]",
    "bytes that are not UTF-8": b'{"a": "\xff"}',
    "3,000 lists in each other": b"[" * 3000,
    "a number of 5,000 digits": b'{"speed": ' + b"9" * 5000 + b"}",
    "one quote instead of two": b"{'speed': 5.5}",
}


def changed(whole: dict[str, Any], change: str) -> bytes:
    """Put a change, as YAML would write it, over an object; what is `(gone)` in it is left out."""
    return json.dumps(_without(merged(whole, yaml.safe_load(f"{{{change}}}")))).encode()


def _without(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {key: _without(each) for key, each in value.items() if each != GONE}
