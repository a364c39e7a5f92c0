"""Questions to logs: what is worked out once is kept, by all that decides it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.toy_world import street

from semgrid_eval.errors import LogError
from semgrid_eval.grids import truth as module
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import Question, WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log

TIMES = WindowTimes(np.array([0]), np.array([[1, 2]]), np.array([3]))
ASKED: list[str] = []


@dataclass(frozen=True)
class Name:
    """A truth that tells the log's name as many times as there are windows, and notes that it was asked."""

    word: str = "a"

    def described(self, config):
        return [self.word]

    def needed(self, times):
        return times

    def find(self, log, config, times):
        ASKED.append(log.scene.name)
        return np.full(len(times.target_ns), len(log.scene.name))


@pytest.fixture
def question(tmp_path):
    path = tmp_path / "logs" / "toy.mcap"
    write_log(street(frames=2).recording("toy_1"), path)
    with LogReader(path) as log:
        return Question(Name(), path, log.digest, GridConfig(), TIMES)


def test_what_was_worked_out_is_kept_and_a_damaged_file_is_made_again(question, tmp_path, caplog):
    ASKED.clear()
    assert question.kept(tmp_path) is None
    assert [question.answer(tmp_path).tolist() for _ in range(2)] == [[5], [5]]
    assert ASKED == ["toy_1"]
    assert not caplog.messages
    question.file(tmp_path).write_bytes(b"no arrays")
    assert question.answer(tmp_path).tolist() == [5]
    assert len(ASKED) == 2
    (warning,) = caplog.messages
    assert warning.startswith(str(question.file(tmp_path)))
    assert warning.endswith("; the truth is worked out again")


def test_the_answer_to_another_question_is_not_taken(question, tmp_path, caplog):
    other = replace(question, truth=Name("b"))
    other.answer(tmp_path)
    other.file(tmp_path).rename(question.file(tmp_path))
    assert question.kept(tmp_path) is None
    assert "belongs to another id" in caplog.text


def test_a_log_that_was_changed_is_not_asked(question, tmp_path):
    changed = replace(question, digest="0" * 16)
    with pytest.raises(LogError, match=rf"toy\.mcap: has digest {question.digest}, not 0{{16}}"):
        changed.answer(tmp_path)
    assert not changed.file(tmp_path).exists()


@pytest.mark.parametrize("version", ["TRUTH_VERSION", "FORMAT_VERSION"])
def test_what_another_version_worked_out_is_not_taken(question, tmp_path, monkeypatch, version):
    """Votes go through projection and rasterising, whose version is that of grids."""
    before = question.file(tmp_path)
    monkeypatch.setattr(module, version, 99)
    assert question.file(tmp_path) != before


def test_another_question_has_another_file(question, tmp_path):
    others = [
        replace(question, truth=Name("b")),
        replace(question, digest="0"),
        replace(question, times=replace(TIMES, target_ns=np.array([4]))),
        replace(question, times=replace(TIMES, first_ns=np.array([1]))),
    ]
    assert len({each.file(tmp_path) for each in (question, *others)}) == 5
