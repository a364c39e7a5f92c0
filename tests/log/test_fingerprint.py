import shutil
from dataclasses import replace

import pytest
from support.driving import driving

from semgrid_eval.errors import LogError
from semgrid_eval.executors import InProcess
from semgrid_eval.log import writer
from semgrid_eval.log.fingerprint import KEPT, fingerprint, fingerprints, kept_fingerprints
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.progress import silent


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "street.mcap"
    write_log(driving(), path)
    return path


def test_another_version_of_the_writer_changes_the_digest_but_not_the_fingerprint(path, tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "__version__", "99.0")
    monkeypatch.setattr(writer, "CHUNK_BYTES", 1 << 12)
    again = tmp_path / "again.mcap"
    write_log(driving(), again)
    assert fingerprint(again) == fingerprint(path)
    with LogReader(again) as one, LogReader(path) as other:
        assert one.digest != other.digest


def test_one_other_byte_in_one_message_changes_the_fingerprint(path, tmp_path):
    *before, last = driving().moments()
    sample = replace(last.motion[-1], speed_mps=last.motion[-1].speed_mps + 1e-9)
    changed = replace(driving(), moments=lambda: iter([*before, replace(last, motion=(*last.motion[:-1], sample))]))
    write_log(changed, tmp_path / "changed.mcap")
    assert fingerprint(tmp_path / "changed.mcap") != fingerprint(path)


def test_the_group_of_a_log_is_told_apart_by_its_digest_but_not_by_the_fingerprint(path, tmp_path):
    grouped = tmp_path / "grouped.mcap"
    write_log(replace(driving(), group="town03"), grouped)
    assert fingerprint(grouped) == fingerprint(path)
    with LogReader(grouped) as one, LogReader(path) as other:
        assert one.digest != other.digest


def test_fingerprints_come_in_the_order_of_the_logs(path, tmp_path):
    other = tmp_path / "other.mcap"
    write_log(replace(driving(), moments=lambda: iter(list(driving().moments())[:-1])), other)
    found = fingerprints([path, other, path], executor=InProcess(), progress=silent)
    assert found == [fingerprint(path), fingerprint(other), fingerprint(path)]
    assert found[0] != found[1]


@pytest.fixture
def damaged(path, tmp_path):
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged.write_bytes(data)
    return damaged


def test_a_damaged_log_is_named(damaged):
    with pytest.raises(LogError, match=r"damaged\.mcap"):
        fingerprint(damaged)


def kept(logs, cache):
    return kept_fingerprints(logs, cache, executor=InProcess(), progress=silent)


def test_what_was_found_once_is_kept(path, tmp_path):
    gone = shutil.copy(path, tmp_path / "gone.mcap")
    logs = {"a" * 16: path, "b" * 16: gone}
    found = kept(logs, tmp_path)
    assert found == dict.fromkeys(logs, fingerprint(path))
    gone.unlink()
    assert kept(logs, tmp_path) == found


@pytest.mark.parametrize("text", ["", "[]", '{"a'])
def test_what_is_kept_is_found_anew_where_it_cannot_be_read(path, tmp_path, text):
    (tmp_path / KEPT).write_text(text)
    assert kept({"a" * 16: path}, tmp_path) == {"a" * 16: fingerprint(path)}


def test_a_damaged_log_has_no_fingerprint_beside_sound_ones(path, damaged, tmp_path):
    assert kept({"a" * 16: damaged, "b" * 16: path}, tmp_path) == {"b" * 16: fingerprint(path)}
