"""Questions to logs: what is worked out once is kept, by all that decides it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.toy_world import street

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


def test_what_was_worked_out_is_kept_and_a_damaged_file_is_made_again(question, tmp_path):
    ASKED.clear()
    assert question.kept(tmp_path) is None
    assert [question.answer(tmp_path).tolist() for _ in range(2)] == [[5], [5]]
    assert ASKED == ["toy_1"]
    question.file(tmp_path).write_bytes(b"no arrays")
    assert question.answer(tmp_path).tolist() == [5]
    assert len(ASKED) == 2


def test_another_question_has_another_file(question, tmp_path):
    others = [
        replace(question, truth=Name("b")),
        replace(question, digest="0"),
        replace(question, times=replace(TIMES, target_ns=np.array([4]))),
        replace(question, times=replace(TIMES, first_ns=np.array([1]))),
    ]
    assert len({each.file(tmp_path) for each in (question, *others)}) == 5
