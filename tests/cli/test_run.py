import re
import shlex

import pytest
import yaml
from click.testing import CliRunner
from support.toy_world import street
from support.unlabelled import unlabelled

from semgrid_eval.cli.main import cli, main
from semgrid_eval.log.store import write_log
from semgrid_eval.models.checkpoint import read_history, write_history
from semgrid_eval.scores.results import read_run

SMALL = {
    "defaults": {"window": {"step_frames": 3, "target_frame": 8}},
    "models": {"ed": {"features": 4, "depth": 2, "training": {"epochs": 2, "updates_per_epoch": 3, "batch": 2}}},
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli") / "logs"
    for i, split in enumerate(("train", "val")):
        write_log(street(i, frames=26).recording(f"toy{i}", split), folder / split / f"toy{i}.mcap")
    return folder


@pytest.fixture
def here(tmp_path, logs, monkeypatch):
    (tmp_path / "logs").symlink_to(logs)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*arguments):
    result = CliRunner().invoke(cli, list(arguments), standalone_mode=False)
    if result.exception:
        raise result.exception
    return result


def example_of(command):
    epilog = call(command, "--help").stdout.partition("Example: semgrid-eval ")[2]
    return shlex.split(epilog)


def matrix(folder, rows):
    path = folder / "m.yaml"
    path.write_text(yaml.safe_dump({**SMALL, "rows": rows}))
    return str(path)


def test_example_of_run_runs(here):
    result = call(*example_of("run"))
    assert result.return_value == 0
    assert result.stdout.splitlines()[-1] == "runs/first"
    assert [row.name for row in read_run(here / "runs" / "first").rows][:2] == ["BL-DC", "BL-NT"]


def test_pictures_for_the_report_can_be_left_out(here):
    arguments = ["run", matrix(here, [{"name": "BL-DC", "model": "newest"}]), "--logs", "logs", "--out", "run"]
    call(*arguments, "--no-pictures")
    assert not (here / "run" / "pictures").exists()
    call(*arguments)
    assert len(list((here / "run" / "pictures").iterdir())) == 1


def test_example_of_grids_runs_and_a_second_time_finds_all(here):
    assert call(*example_of("grids")).return_value == 0
    assert "0 logs built, 2 re-used" in call(*example_of("grids")).stderr


@pytest.mark.slow
def test_dry_run_tells_updates_and_minutes_and_trains_nothing(here):
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "ED-DC", "model": "ed"}, {"name": "ED-SL2", "model": "ed"}]
    arguments = ["run", matrix(here, rows), "--logs", "logs", "--out", "run"]
    table = [line.split("\t") for line in call(*arguments, "--dry-run").stdout.splitlines()]
    assert [line[0] for line in table] == ["rows", "BL-DC", "ED-DC,ED-SL2"]
    assert table[2][1:5] == ["0", "1", "6", "12"]
    assert not (here / "run" / "trainings").exists()
    assert not (here / "run" / "results").exists()
    assert re.search(
        r"About \d+ minutes on this machine, 2 at a time\.", call(*arguments, "--dry-run", "--jobs", "2").stderr
    )
    alone = call(*arguments, "--dry-run", "--row", "ED-SL2").stdout.splitlines()
    assert [line.split("\t")[0] for line in alone] == ["rows", "ED-DC,ED-SL2"]
    call(*arguments)
    assert call(*arguments, "--dry-run").stdout.count("\tdone") == 2


@pytest.mark.slow
def test_dry_run_counts_only_the_epochs_that_are_not_trained_yet(here):
    rows = [{"name": "ED-DC", "model": "ed"}]
    (here / "trainings").mkdir()
    arguments = ["run", matrix(here, rows), "--logs", "logs", "--trainings", "trainings"]
    call(*arguments, "--out", "first")
    planned = [*arguments, "--out", "second", "--dry-run"]
    assert call(*planned).stdout.splitlines()[1].split("\t")[3:6] == ["0", "0", "0.0"]
    (history,) = (here / "trainings").glob("*/history.csv")
    write_history(history, read_history(history)[:-1])
    assert call(*planned).stdout.splitlines()[1].split("\t")[3:5] == ["3", "6"]


@pytest.mark.slow
def test_dry_run_counts_a_training_that_rows_share_once(here):
    rows = [{"name": "ED-DC", "model": "ed"}, {"name": "ED-all", "model": "ed", "mask_mode": "off"}]
    planned = call("run", matrix(here, rows), "--logs", "logs", "--out", "run", "--dry-run").stdout.splitlines()
    assert [line.split("\t")[3:5] for line in planned[1:]] == [["6", "12"], ["0", "0"]]


BAD_MODELS = """
import torch
from semgrid_eval.models.model import Model

class Small(Model):
    def predict(self, batch):
        return torch.zeros(len(batch.target), 10, 4, 4)

class NotANumber(Model):
    def predict(self, batch):
        return torch.full((len(batch.target), 10, 128, 128), torch.nan)
"""


@pytest.mark.slow
def test_whatever_fails_is_one_line_each_and_the_others_go_on(here, tmp_path_factory):
    logs = tmp_path_factory.mktemp("unlabelled")
    write_log(street(1, frames=9).recording("good", "val"), logs / "good.mcap")
    write_log(unlabelled(street(2, frames=9).recording("bare", "val")), logs / "bare.mcap")
    (here / "bad.py").write_text(BAD_MODELS)
    rows = [
        {"name": "small", "model": "bad.py:Small"},
        {"name": "nan", "model": "bad.py:NotANumber"},
        {"name": "far", "model": "newest", "window": {"horizon_steps": 5, "target_frame": 18}},
        {"name": "BL-DC", "model": "newest"},
    ]
    result = call("run", matrix(here, rows), "--logs", str(logs), "--out", "run", "--workers", "1")
    assert result.return_value == 1
    assert [line for line in result.stderr.splitlines() if line.startswith("Error")] == [
        "Error: row small: bad.py:Small: gave shape (1, 10, 4, 4) where (1, 10, 128, 128) is needed",
        "Error: row nan: bad.py:NotANumber: gave scores that are NaN or infinite",
        "Error: row far: a window needs 19 frames, and the longest recording (of 1) has 9",
        "Error: bare.mcap: frame at 1000000000000000000 ns: has no label image; `semgrid-eval segment` adds them",
    ]
    assert [row.name for row in read_run(here / "run").rows if row.results] == ["BL-DC"]


def test_a_failing_row_is_one_line_and_exit_code_1(here):
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-x", "model": "newest", "validation_split": "nowhere"}]
    result = call("run", matrix(here, rows), "--logs", "logs", "--out", "run")
    assert result.return_value == 1
    errors = [line for line in result.stderr.splitlines() if line.startswith("Error")]
    assert errors == [
        "Error: row BL-x: no recording of split 'nowhere' gave grids (splits found: train, val)",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "m.yaml", "--logs", "logs", "--out", "run"], "m.yaml: is neither a file nor a preset"),
        (["run", "misspelt.yaml", "--logs", "logs", "--out", "run"], "row 'a': modle: unknown key; allowed here:"),
        (
            ["run", "no_class.yaml", "--logs", "logs", "--out", "run"],
            "grid: class_map.car: 'rood' is not one of unknown",
        ),
        (
            ["run", "smoke", "--logs", "logs", "--out", "run", "--device", "tpu"],
            "device: there is no device 'tpu' on this machine",
        ),
        (["run", "smoke", "--logs", "empty", "--out", "run"], "empty: holds no .mcap log"),
        (["run", "smoke", "--logs", "logs", "--out", "file/run"], "cannot be written"),
        (["grids", "logs", "out", "--config", "grid.yaml"], "grid.yaml: morfology: unknown key"),
    ],
)
def test_a_users_mistake_is_one_line_without_a_traceback(here, capsys, arguments, message):
    (here / "empty").mkdir()
    (here / "file").write_text("")
    (here / "grid.yaml").write_text("morfology: off")
    (here / "misspelt.yaml").write_text("rows: [{name: a, modle: ed}]")
    (here / "no_class.yaml").write_text("rows: [{name: a, model: ed, grid: {class_map: {car: rood}}}]")
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("grids:")]
    assert len(lines) == 1
    assert lines[0].startswith("Error: ")
    assert message in lines[0]


@pytest.mark.slow
def test_what_is_damaged_is_made_again_with_a_line_each(here, capsys):
    arguments = ["run", matrix(here, [{"name": "BL-DC", "model": "newest"}]), "--logs", "logs", "--out", "run"]
    kinds = {"results/*/sums.npz": "result is", "windows/*.npz": "windows are", "grids/*.npz": "grids are"}
    call(*arguments)
    for pattern in kinds:
        path = min((here / "run").glob(pattern))
        content = bytearray(path.read_bytes())
        content[50] ^= 1
        path.write_bytes(content)
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 0
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("Warning: ")]
    for pattern, word in kinds.items():
        assert [line for line in said if pattern.partition("/")[0] in line and f"the {word}" in line], said


@pytest.mark.slow
def test_a_model_that_ends_its_process_is_a_row_that_fails(here, capsys):
    (here / "mine.py").write_text("import os\nos._exit(4)\n")
    rows = [{"name": "mine", "model": "mine.py:Mine"}, {"name": "BL", "model": "newest"}]
    with pytest.raises(SystemExit) as ended:
        main(
            ["run", matrix(here, rows), "--logs", "logs", "--out", "out", "--memory-limit", "4", "--time-limit", "900"]
        )
    assert ended.value.code == 1
    assert "Error: row mine: mine.py:Mine: ended its process with exit code 4\n" in capsys.readouterr().err
    assert [row.failure is None for row in read_run(here / "out").rows] == [False, True]
