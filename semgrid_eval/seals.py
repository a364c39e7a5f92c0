"""Seals: what a run keeps holds a digest of its own bytes and the id of what it belongs to.

A seal is a short text somewhere in a file: `semgrid-eval seal OWNER SHA256`. The digest is that of the whole file with
64 zeros in its place, so it covers every byte, and being inside it moves into place together with them. In an npz it is
the comment of the archive, in JSON the last key, in CSV a comment in the last line, in weights part of the header.
"""

import hashlib
import json
import re
from pathlib import Path
from typing import Any

from semgrid_eval.errors import DamageError, InputError, ResultError
from semgrid_eval.files import JSON_LIMIT_BYTES, READ_LIMIT_BYTES, atomic_file, read_bytes

_MARK = b"semgrid-eval seal "
_BLANK = b"0" * 64
_OWNER = re.compile(r"[!#-~]{1,100}")
_SEAL = re.compile(re.escape(_MARK) + b"(" + _OWNER.pattern.encode() + rb") ([0-9a-f]{64})")
_NOBODY = "-"
_JSON_KEY = "seal"


def open_seal(owner: str = "") -> str:
    """Return the text that content to be sealed holds, behind any other of its kind; `owner` is the id of a thing.

    Raises:
        ValueError: a reader could not find such an owner again.
    """
    if not _OWNER.fullmatch(owner or _NOBODY):
        raise ValueError(f"{owner!r} cannot own a file: it is not 1 to 100 plain characters without spaces")
    return f"{_MARK.decode()}{owner or _NOBODY} {_BLANK.decode()}"


def sealed(content: bytes) -> bytes:
    """Put the digest of the content into its open seal."""
    at = content.rindex(_MARK)
    start = content.index(_BLANK, at)
    digest = hashlib.sha256(content).hexdigest().encode()
    return b"".join((content[:start], digest, content[start + len(_BLANK) :]))


def check_seal(content: bytes, path: Path, owner: str | None = None) -> None:
    """Compare content with its seal, and its owner with the one that is expected, if any is.

    Raises:
        DamageError: there is no seal, or the bytes are not those that were sealed.
        ResultError: it belongs to something else.
    """
    at = content.rfind(_MARK)
    found = _SEAL.match(content, at) if at >= 0 else None
    if found is None:
        raise DamageError("is damaged, or of another version: it has no seal", path=path)
    digest, view = hashlib.sha256(), memoryview(content)
    for part in (view[: found.start(2)], _BLANK, view[found.end(2) :]):
        digest.update(part)
    if digest.hexdigest().encode() != found[2]:
        raise DamageError("is damaged: its content does not match its seal", path=path)
    if owner is not None and found[1].decode() != (owner or _NOBODY):
        raise ResultError(f"belongs to another id ({found[1].decode()}, not {owner or _NOBODY})", path=path)


def read_sealed(path: Path, owner: str | None = None, *, limit: int = READ_LIMIT_BYTES) -> bytes:
    """Read a sealed file of at most `limit` bytes whole.

    Raises:
        ResultError: it is missing, or as `check_seal` says.
    """
    try:
        content = read_bytes(path, limit=limit)
    except InputError as error:
        raise ResultError(str(error).removeprefix(f"{path}: "), path=path) from error
    check_seal(content, path, owner)
    return content


def write_sealed(path: Path, content: bytes) -> None:
    """Seal content that holds an open seal and write it atomically."""
    with atomic_file(path) as stream:
        stream.write(sealed(content))


def write_sealed_json(path: Path, value: dict[str, Any], owner: str) -> None:
    """Write a JSON object as `write_json` does, with a seal as its last entry."""
    text = json.dumps(value, indent=2, sort_keys=True, allow_nan=False).removesuffix("}").rstrip()
    comma = "," if value else ""
    write_sealed(path, f'{text}{comma}\n  "{_JSON_KEY}": "{open_seal(owner)}"\n}}\n'.encode())


def read_sealed_json(path: Path, owner: str | None = None) -> dict[str, Any]:
    """Read a JSON object that was written with a seal.

    Raises:
        ResultError: it is missing, or as `check_seal` says.
    """
    content = read_sealed(path, owner, limit=JSON_LIMIT_BYTES)
    try:
        value: dict[str, Any] = json.loads(content)
        del value[_JSON_KEY]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DamageError("is not a JSON object with a seal", path=path) from error
    return value
