from dataclasses import replace

import pytest
from support.driving import driving

from semgrid_eval.errors import LogError
from semgrid_eval.executors import InProcess
from semgrid_eval.log import writer
from semgrid_eval.log.fingerprint import fingerprint, fingerprints
from semgrid_eval.log.store import LogReader, write_log
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


def test_fingerprints_come_in_the_order_of_the_logs(path, tmp_path):
    other = tmp_path / "other.mcap"
    write_log(replace(driving(), moments=lambda: iter(list(driving().moments())[:-1])), other)
    found = fingerprints([path, other, path], executor=InProcess(), progress=silent)
    assert found == [fingerprint(path), fingerprint(other), fingerprint(path)]
    assert found[0] != found[1]


def test_a_damaged_log_is_named(path, tmp_path):
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged.write_bytes(data)
    with pytest.raises(LogError, match=r"damaged\.mcap"):
        fingerprint(damaged)
