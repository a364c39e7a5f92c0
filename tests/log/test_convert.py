import errno
import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from functools import partial

import pytest
from support.driving import driving

from semgrid_eval.errors import InputError
from semgrid_eval.log.convert import ConversionJob, Work, convert_jobs, convert_recordings
from semgrid_eval.log.reader import LogReader


def refuse(reason):
    raise InputError(reason, path="camera.json", field="intrinsic.fx")


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def job(name, load=driving, digest="d" * 16):
    return ConversionJob(name=name, split="val", digest=digest, load=load)


def convert(jobs, out, workers=1):
    return convert_jobs(jobs, out, Work(workers))


@pytest.mark.parametrize("workers", [1, 2])
def test_good_recordings_are_written_though_others_fail(tmp_path, workers):
    bad = job("bad", partial(refuse, "is missing"))
    worse = job("worse", digest=partial(refuse, "is broken"))
    summary = convert([job("b"), bad, job("a"), worse], tmp_path, workers)
    assert summary.written == ["val/a", "val/b"]
    assert summary.failed == {
        "val/bad": "camera.json: intrinsic.fx: is missing",
        "val/worse": "camera.json: intrinsic.fx: is broken",
    }
    assert sorted(path.name for path in (tmp_path / "val").iterdir()) == ["a.mcap", "b.mcap"]
    assert (tmp_path / "val/a.mcap").read_bytes() == (tmp_path / "val/b.mcap").read_bytes()


def test_logs_of_unchanged_inputs_are_left_as_they_are(tmp_path):
    convert([job("a"), job("b")], tmp_path)
    before = (tmp_path / "val/a.mcap").stat().st_mtime_ns
    summary = convert([job("a"), job("b", digest="d".replace("d", "d" * 16).format)], tmp_path)
    assert (summary.written, summary.skipped) == ([], ["val/a", "val/b"])
    assert (tmp_path / "val/a.mcap").stat().st_mtime_ns == before


def test_logs_of_changed_inputs_are_written_again(tmp_path):
    convert([job("a")], tmp_path)
    changed = job("a", partial(driving, digest="e" * 16), digest="e" * 16)
    assert convert([changed], tmp_path).written == ["val/a"]
    with LogReader(tmp_path / "val/a.mcap") as log:
        assert log.scene.source_digest == "e" * 16


@pytest.mark.parametrize("place", [0, 0.3, 0.6, -1])
def test_damaged_logs_are_written_again(tmp_path, place):
    convert([job("a")], tmp_path)
    path = tmp_path / "val/a.mcap"
    whole = path.read_bytes()
    damaged = bytearray(whole)
    damaged[place if place in (0, -1) else int(place * len(whole))] ^= 1
    path.write_bytes(damaged)
    assert convert([job("a")], tmp_path).written == ["val/a"]
    assert path.read_bytes() == whole


def test_two_recordings_of_one_name_are_refused(tmp_path):
    with pytest.raises(InputError, match="val/a: two recordings have this name"):
        convert([job("a"), job("a")], tmp_path)


def test_killed_worker_is_a_failure_that_is_named(tmp_path):
    summary = convert([job("a", die), job("b", die)], tmp_path, workers=2)
    assert set(summary.failed) == {"val/a", "val/b"}
    assert "worker process was killed" in summary.failed["val/a"]


@pytest.mark.parametrize("workers", [1, 2])
def test_interrupted_conversion_leaves_whole_logs_and_goes_on_from_there(tmp_path, workers):
    jobs = [job(name) for name in "abcdef"]

    def interrupt(done, total, message=""):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert_jobs(jobs, tmp_path, Work(workers, stage=lambda label: nullcontext(interrupt)))
    left = [f"val/{path.stem}" for path in sorted((tmp_path / "val").glob("[!.]*"))]  # what was being written is hidden
    assert left if workers == 2 else left == ["val/a"]  # another process may have finished its own
    summary = convert(jobs, tmp_path)
    assert summary.skipped == left
    assert sorted([*summary.written, *summary.skipped]) == [f"val/{name}" for name in "abcdef"]
    assert sorted(path.name for path in (tmp_path / "val").iterdir()) == [f"{name}.mcap" for name in "abcdef"]


def test_a_full_disk_ends_the_conversion_in_one_line_and_what_is_written_stays(tmp_path, monkeypatch):
    def fill_the_disk(descriptor):
        if (tmp_path / "val/b.mcap").exists():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fill_the_disk)
    line = r"c\.mcap: cannot be written: No space left on device; what is written is whole"
    with pytest.raises(InputError, match=line):
        convert([job(name) for name in "abcd"], tmp_path)
    assert sorted(path.name for path in (tmp_path / "val").iterdir()) == ["a.mcap", "b.mcap"]
    monkeypatch.undo()
    summary = convert([job(name) for name in "abcd"], tmp_path)
    assert (summary.skipped, summary.written) == (["val/a", "val/b"], ["val/c", "val/d"])


def test_progress_names_every_recording_once(tmp_path):
    told = []
    jobs = [job("a"), job("b", partial(refuse, "is missing"))]
    convert_jobs(jobs, tmp_path, Work(stage=lambda label: nullcontext(lambda *call: told.append((label, *call)))))
    assert told == [("convert", 1, 2, "val/a"), ("convert", 2, 2, "val/b")]


def test_recordings_that_a_source_yields_are_converted(tmp_path):
    def source():
        for name in "ab":
            yield replace(driving(), name=name, group="here")

    assert convert_recordings(source(), tmp_path).written == ["val/a", "val/b"]
    assert convert_recordings(source(), tmp_path).skipped == ["val/a", "val/b"]
    with LogReader(tmp_path / "val/a.mcap") as log:
        assert (log.scene.name, log.scene.group) == ("a", "here")


def test_a_file_that_a_source_does_not_find_is_named_and_the_rest_is_converted(tmp_path):
    def moments():
        (tmp_path / "input").read_bytes()
        yield

    bad = job("bad", lambda: replace(driving(), moments=moments))
    summary = convert([bad, job("good")], tmp_path / "logs")
    assert summary.written == ["val/good"]
    assert summary.failed == {"val/bad": f"[Errno 2] No such file or directory: '{tmp_path}/input'"}


def test_nothing_to_convert_is_no_error(tmp_path):
    assert convert([], tmp_path, workers=2).written == []
