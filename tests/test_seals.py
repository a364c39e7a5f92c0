"""Seals: every byte of a file and its owner count."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.errors import DamageError, InputError, ResultError
from semgrid_eval.seals import (
    check_seal,
    open_seal,
    read_sealed_json,
    sealed,
    write_sealed,
    write_sealed_json,
)

HERE = Path("file")


@given(st.binary(), st.binary(), st.data())
def test_any_other_byte_is_seen(before, after, data):
    content = sealed(before + open_seal("owner").encode() + after)
    check_seal(content, HERE, "owner")
    at, bit = data.draw(st.integers(0, len(content) - 1)), data.draw(st.integers(0, 7))
    changed = bytearray(content)
    changed[at] ^= 1 << bit
    with pytest.raises(DamageError, match=r"^file: is damaged"):
        check_seal(bytes(changed), HERE)


@pytest.mark.parametrize("change", [lambda content: content[:-1], lambda content: content + b"x", lambda _: b""])
def test_what_is_longer_or_shorter_is_seen(change):
    with pytest.raises(DamageError):
        check_seal(change(sealed(b"text " + open_seal().encode())), HERE)


def test_the_last_seal_counts_whatever_words_are_before_it():
    content = sealed(f"{open_seal('other')} {open_seal('mine')}".encode())
    check_seal(content, HERE, "mine")
    with pytest.raises(ResultError, match=r"file: belongs to another id \(mine, not other\)"):
        check_seal(content, HERE, "other")


@pytest.mark.parametrize("value", [{}, {"a": 1, "z": [1, {"seal": "x"}]}, {"title": open_seal("me")}])
def test_json_comes_back_and_stays_json(tmp_path, value):
    path = tmp_path / "a.json"
    write_sealed_json(path, value, "me")
    assert read_sealed_json(path, "me") == value
    assert json.loads(path.read_bytes()).keys() == {*value, "seal"}
    with pytest.raises(ResultError, match="belongs to another id"):
        read_sealed_json(path, "you")


def test_a_sealed_file_that_is_no_json_is_damaged(tmp_path):
    write_sealed(tmp_path / "a.json", b"\xff" + open_seal("me").encode())
    with pytest.raises(DamageError, match="is not a JSON object with a seal"):
        read_sealed_json(tmp_path / "a.json", "me")
    with pytest.raises(InputError, match="cannot be read"):
        read_sealed_json(tmp_path / "none.json", "me")


@pytest.mark.parametrize("owner", ["my toy", "\u00fc", 'a"b', "a\n", "a" * 101])
def test_an_owner_that_cannot_be_read_again_is_refused(owner):
    with pytest.raises(ValueError, match="cannot own a file"):
        open_seal(owner)
