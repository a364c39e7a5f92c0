"""Models of one's own in processes apart: whatever their code does, its row fails with a reason, others go on."""

import os
from pathlib import Path

import pytest
import torch
from support.small_runs import run

from semgrid_eval.executors import Processes
from semgrid_eval.models.registry import described, own_models
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums
from semgrid_eval.workplace import Limits

RUDE = """
import ctypes, os, signal, sys, time
import numpy as np
import torch
from semgrid_eval.models.model import Model, one_hot
from semgrid_eval.models.network import Network, input_planes

class Newest(Model):
    files = ()
    def predict(self, batch):
        return self.rude(batch) or one_hot(batch.past[:, 0, -1])
    def rude(self, batch):
        pass

class Leaves(Newest):
    def rude(self, batch):
        os._exit(7)

class Crashes(Newest):
    def rude(self, batch):
        ctypes.string_at(0)

class Hangs(Newest):
    def fit(self, windows):
        while True:
            time.sleep(60)

class Swells(Newest):
    def rude(self, batch):
        self.kept = [np.ones(1 << 24) for _ in range(1 << 10)]

class Talks(Newest):
    def rude(self, batch):
        print("a word")
        os.write(1, b"and another\\n")

class Closes(Newest):
    def rude(self, batch):
        os.closerange(3, 256)

class Babbles(Newest):
    def rude(self, batch):
        for descriptor in range(3, 64):
            try:
                if os.readlink(f"/proc/self/fd/{descriptor}").startswith("socket:"):
                    os.write(descriptor, b"x" * 4096)
            except OSError:
                pass

class Doubles(Newest):
    def rude(self, batch):
        if os.fork() == 0:
            return one_hot(batch.past[:, 0, 0])

class Dies(Network):
    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.layer = torch.nn.Conv2d(given.planes, 10, 1)
    def forward(self, batch):
        if self.training:
            os.kill(os.getpid(), signal.SIGKILL)
        return self.layer(input_planes(batch.past))
"""
CHANCE = """
import torch
from semgrid_eval.models.model import Model, one_hot

class Chance(Model):
    random = True
    files = ()

    def fit(self, windows):
        self.drawn = int(torch.randint(0, 10, ())) + len(windows)

    def predict(self, batch):
        return one_hot((torch.randint(0, 10, batch.target.shape) + self.drawn).remainder(10).to(torch.uint8))
"""
TRAINING = {"epochs": 1, "updates_per_epoch": 2, "batch": 2}
MANY = Limits(memory_bytes=4 << 30)


@pytest.fixture(autouse=True)
def apart():
    with own_models(MANY):
        yield


def rows_of(folder, code, *names):
    (folder / "rude.py").write_text(code)
    rows = [{"name": name, "model": f"{folder}/rude.py:{name}"} for name in names]
    for row in rows:
        row |= {"settings": {"training": TRAINING}} if row["name"] == "Dies" else {}
    return [*rows, {"name": "BL-DC", "model": "newest"}]


def sums_of(out, record, name):
    row = next(row for row in record.rows if row.name == name)
    return [read_sums(results.result_folder(out, each), "iou", "all").tobytes() for each in row.results]


ENDS = {
    "Leaves": "ended its process with exit code 7",
    "Crashes": "was killed by SIGSEGV",
    "Dies": "was killed by SIGKILL (out of memory?)",
    "Swells": "out of memory: ",
    "Closes": "",
    "Babbles": "sent what is not an answer to the run",
}


@pytest.mark.slow
def test_whatever_ends_a_process_apart_is_the_reason_of_its_row_alone(logs, tmp_path):
    rows = rows_of(tmp_path, RUDE, *ENDS)
    record = run(rows, logs, tmp_path / "run")
    for row in record.rows[:-1]:
        name = "" if row.name == "Swells" else f"{tmp_path}/rude.py:{row.name}: "
        assert str(row.failure).startswith(name + ENDS[row.name]), row.failure
        assert "\n" not in str(row.failure)
    assert record.rows[-1].failure is None


@pytest.mark.slow
def test_what_hangs_is_ended_after_the_limit_and_the_rest_goes_on(logs, tmp_path):
    rows = rows_of(tmp_path, RUDE, "Hangs")
    with own_models(Limits(time_s=10)):
        record = run(rows, logs, tmp_path / "run")
    assert record.rows[0].failure == f"{rows[0]['model']}: gave no sign for 10 s and was ended (--time-limit)"
    assert record.rows[1].failure is None


@pytest.mark.slow
def test_what_is_printed_or_doubled_changes_nothing(logs, tmp_path, capfd):
    record = run(rows_of(tmp_path, RUDE, "Newest", "Talks", "Doubles"), logs, tmp_path / "run")
    assert [row.failure for row in record.rows] == [None] * 4
    assert len({sums_of(tmp_path / "run", record, row.name)[0] for row in record.rows}) == 1
    printed, errors = capfd.readouterr()
    assert printed == ""
    assert "a word" in errors
    assert "and another" in errors


@pytest.mark.slow
def test_a_file_that_ends_its_process_is_told_of_once_for_all_its_rows(logs, tmp_path):
    rows = rows_of(tmp_path, f"import os\nopen({str(tmp_path / 'times')!r}, 'a').write('x')\nos._exit(3)", "Mine")
    record = run([{**rows[0], "name": f"own{n}"} for n in range(3)] + rows[1:], logs, tmp_path / "run")
    told = f"{rows[0]['model']}: ended its process with exit code 3"
    assert [row.failure for row in record.rows] == [told] * 3 + [None]
    assert (tmp_path / "times").read_text() == "x"
    rows_of(tmp_path, RUDE.replace("class Newest", "class Mine").replace("(Newest)", "(Mine)"), "Mine")
    assert run(rows[:1], logs, tmp_path / "run").rows[0].failure is None  # what was mended is loaded


@pytest.mark.slow
def test_numbers_are_the_same_apart_here_and_in_several_processes(logs, tmp_path):
    rows = [{**row, "repeats": 2} if row["name"] == "Chance" else row for row in rows_of(tmp_path, CHANCE, "Chance")]
    threads = torch.get_num_threads()
    ways = {"apart": (MANY, None), "here": (None, None), "both": (MANY, Processes(2, threads=threads))}
    found = {}
    for name, (limits, executor) in ways.items():
        with own_models(limits):
            record = run(rows, logs, tmp_path / name, executor)
        found[name] = record.rows[0].results, sums_of(tmp_path / name, record, "Chance")
    assert found["apart"] == found["here"] == found["both"]
    assert len(set(found["apart"][1])) == 2


def test_what_a_model_does_apart_to_the_runs_folder_is_named(logs, tmp_path):
    text = (
        RUDE
        + f"""
class Spoils(Newest):
    def rude(self, batch):
        from pathlib import Path
        for file in Path({str(tmp_path / "run")!r}).glob("results/*/sums.npz"):
            file.write_bytes(b"better")
"""
    )
    rows = rows_of(tmp_path, text, "Spoils")[::-1]
    record = run(rows, logs, tmp_path / "run")
    result = Path(run(rows, logs, tmp_path / "other", only=("BL-DC",)).rows[0].results[0])
    assert record.rows[1].failure == (
        f"{tmp_path}/rude.py:Spoils: changed or removed results/{result} in the run's folder"
    )
    assert "removed or damaged while the run went on" in str(record.rows[0].failure)


def test_no_process_is_left_when_the_models_are_done_with(logs, tmp_path):
    pid = tmp_path / "pid"
    text = f"import os, pathlib\npathlib.Path({str(pid)!r}).write_text(str(os.getpid()))\n" + RUDE
    with own_models(MANY):
        described(rows_of(tmp_path, text, "Newest")[0]["model"])
    assert int(pid.read_text()) != os.getpid()
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)
