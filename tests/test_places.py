"""Names in a folder: swapped in one step or brought back, and what killed processes left is removed."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from semgrid_eval.files import atomic_file, atomic_folder
from semgrid_eval.places import exchange, held_folder, partial_of, remove_stale

WRITER = """
import sys
from pathlib import Path
from semgrid_eval.files import atomic_file, atomic_folder
with atomic_file(Path("out/file")) as stream, atomic_folder(Path("out/folder")) as folder:
    stream.write(b"half")
    (folder / "half").touch()
    print("writing", flush=True)
    sys.stdin.read()
"""


class Killed(BaseException):
    """Stands for a kill."""


def replace_folder(path, word):
    with atomic_folder(path) as folder:
        (folder / "word").write_text(word)


def stop_after(monkeypatch, count):
    """Let a process end, without a chance to remove anything, when it has changed so many names of folders."""
    names, original = iter(range(count)), Path.replace

    def replace(path, target):
        if next(names, None) is None:
            raise Killed
        return original(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(shutil, "rmtree", lambda *_args, **_options: None)


@pytest.mark.parametrize("exchanges", [True, False])
@pytest.mark.parametrize("changes", [0, 1, 2])
def test_a_folder_is_there_at_every_moment_or_the_next_writer_brings_it_back(tmp_path, monkeypatch, exchanges, changes):
    target, real = tmp_path / "target", exchange
    monkeypatch.setattr("semgrid_eval.places.exchange", real if exchanges else lambda *_: False)
    replace_folder(target, "old")
    with monkeypatch.context() as patch:
        stop_after(patch, changes)
        ended = False
        try:
            replace_folder(target, "new")
            ended = True
        except Killed:
            pass
    assert ended == (exchanges or changes == 2)
    seen = []
    with atomic_folder(target) as folder:
        seen.append((target / "word").read_text())
        (folder / "word").write_text("newer")
    assert seen == ["new" if ended else "old"]
    assert (target / "word").read_text() == "newer"


def test_what_a_killed_process_was_writing_is_removed_and_what_others_write_stays(tmp_path):
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-c", WRITER]
    dead, alive = (
        subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE) for _ in range(2)
    )
    for process in (dead, alive):
        assert process.stdout.readline() == b"writing\n"
    dead.send_signal(signal.SIGKILL)
    dead.communicate()
    assert len(list((tmp_path / "out").iterdir())) == 4
    (tmp_path / "out" / ".mine.part").touch()
    remove_stale(tmp_path)
    assert len(list((tmp_path / "out").iterdir())) == 3
    alive.communicate(b"")
    assert alive.returncode == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"file", "folder", ".mine.part"}
    assert (tmp_path / "out" / "folder" / "half").is_file()


def test_a_file_that_somebody_removes_before_it_is_shown_to_be_written_is_begun_again(tmp_path, monkeypatch):
    names = []

    def partial(path):
        names.append(partial_of(path))
        return names[-1]

    monkeypatch.setattr("semgrid_eval.files.partial_of", partial)
    held = iter([lambda descriptor: names[0].unlink()])

    def hold(descriptor):
        next(held, lambda _: None)(descriptor)
        return os.fstat(descriptor).st_nlink > 0

    monkeypatch.setattr("semgrid_eval.files.hold", hold)
    with atomic_file(tmp_path / "out") as stream:
        stream.write(b"whole")
    assert len(names) == 2
    assert (tmp_path / "out").read_bytes() == b"whole"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_that_another_process_takes_for_one_that_was_left_is_made_again(tmp_path, monkeypatch):
    system_open, taken = os.open, []

    def take_first(path, *options):
        if not taken:
            taken.append(path)
            Path(path).rmdir()
        return system_open(path, *options)

    monkeypatch.setattr(os, "open", take_first)
    with held_folder(tmp_path / "folder") as made:
        assert made.is_dir()
        assert made not in taken
