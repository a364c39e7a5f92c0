import errno
import hashlib
import os
import resource
from contextlib import contextmanager

import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file, atomic_folder, digest_files, digest_value, read_json, write_json


def test_nothing_is_seen_when_writing_fails(tmp_path):
    def write_badly():
        with atomic_file(tmp_path / "out.bin") as stream:
            stream.write(b"half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write_badly()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_replaces_the_old_one_only_when_complete(tmp_path):
    target = tmp_path / "result"
    with atomic_folder(target) as folder:
        (folder / "a").write_text("old")

    def write_badly():
        with atomic_folder(target) as folder:
            (folder / "b").write_text("new")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write_badly()
    assert [p.name for p in target.iterdir()] == ["a"]
    with atomic_folder(target) as folder:
        (folder / "b").write_text("new")
    assert [p.name for p in target.iterdir()] == ["b"]
    assert [p.name for p in tmp_path.iterdir()] == ["result"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file/x: cannot be written"), atomic_file(tmp_path / "file" / "x"):
        pass


@pytest.mark.parametrize("output", [atomic_file, atomic_folder])
def test_a_missing_input_read_while_writing_names_the_input(tmp_path, output):
    with pytest.raises(FileNotFoundError) as raised, output(tmp_path / "out"):
        (tmp_path / "input").read_bytes()
    assert raised.value.filename == str(tmp_path / "input")
    with pytest.raises(InputError, match="input: cannot be read"), output(tmp_path / "out"):
        read_json(tmp_path / "input")
    assert list(tmp_path.iterdir()) == []


@contextmanager
def little_room():
    """Let files of this process have 4 KiB at most: inside the test alone, since pytest may write to a file as well."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [5000, 1 << 20])  # written by the flush at the end, or at once
def test_a_write_that_fails_names_the_output(tmp_path, size):
    with (
        little_room(),
        pytest.raises(InputError, match=r"out: cannot be written: File too large$") as raised,
        atomic_file(tmp_path / "out") as stream,
    ):
        stream.write(b"1" * size)
    assert raised.value.__cause__.errno == errno.EFBIG
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_names_the_folder(tmp_path):
    with (
        pytest.raises(InputError, match=r"out: cannot be written: No space"),
        atomic_folder(tmp_path / "out") as folder,
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder / "a"))
    assert list(tmp_path.iterdir()) == []


def test_an_array_that_was_written_in_part_is_a_full_disk(tmp_path):
    with (
        pytest.raises(InputError, match=r"town: cannot be written: 8 requested and 3 written \(no space left\?\)"),
        atomic_folder(tmp_path / "town"),
    ):
        raise OSError("8 requested and 3 written")  # as numpy has it
    assert list(tmp_path.iterdir()) == []


def test_digest_of_a_value_ignores_the_order_of_keys_but_no_value():
    assert digest_value({"a": 1, "b": [1, 2]}) == digest_value({"b": [1, 2], "a": 1})
    assert digest_value({"a": 1}) != digest_value({"a": 2})


def test_digest_of_files_depends_on_where_one_ends(tmp_path):
    for name, content in {"a": b"12", "b": b"3", "c": b"1", "d": b"23"}.items():
        (tmp_path / name).write_bytes(content)
    first = digest_files([tmp_path / "a", tmp_path / "b"])
    assert first != digest_files([tmp_path / "c", tmp_path / "d"])
    parts = hashlib.sha256(b"12").digest() + hashlib.sha256(b"3").digest()
    assert hashlib.sha256(parts).hexdigest().startswith(first)


def test_json_that_is_broken_names_the_file(tmp_path):
    write_json(tmp_path / "good.json", {"b": 1, "a": [None, "ü"]})
    assert read_json(tmp_path / "good.json") == {"a": [None, "ü"], "b": 1}
    (tmp_path / "bad.json").write_text('{"a": ')
    with pytest.raises(InputError, match=r"bad\.json: is not valid JSON"):
        read_json(tmp_path / "bad.json")
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        read_json(tmp_path / "none.json")
