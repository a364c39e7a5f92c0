import shlex
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner
from mcap.reader import make_reader
from support.exact_grids import read_exact
from support.toy_world import street

from semgrid_eval.cli.main import cli, main
from semgrid_eval.errors import InputError
from semgrid_eval.log.store import write_log


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A folder with logs and a run."""
    folder = tmp_path_factory.mktemp("play")
    write_log(street(0, frames=9).recording("toy"), folder / "logs" / "val" / "toy.mcap")
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-NT", "model": "newest", "translate": False}]
    defaults = {"window": {"step_frames": 3, "target_frame": 8}}
    (folder / "m.yaml").write_text(yaml.safe_dump({"defaults": defaults, "rows": rows}))
    call("run", str(folder / "m.yaml"), "--logs", str(folder / "logs"), "--out", str(folder / "runs" / "first"))
    return folder


@pytest.fixture
def here(tmp_path, workplace, monkeypatch):
    for name in ("logs", "runs"):
        (tmp_path / name).symlink_to(workplace / name)
    monkeypatch.chdir(tmp_path)


def call(*arguments):
    result = CliRunner().invoke(cli, list(arguments), standalone_mode=False)
    if result.exception:
        raise result.exception
    return result


def test_example_of_play_writes_a_log_and_a_layout(here):
    result = call(*shlex.split(call("play", "--help").stdout.partition("Example: semgrid-eval ")[2]))
    assert result.stdout == "play.mcap\n"
    assert "play.layout.json" in result.stderr
    assert Path("play.layout.json").is_file()
    with Path("play.mcap").open("rb") as stream:
        topics = {channel.topic for channel in make_reader(stream).get_summary().channels.values()}
    assert {"/grid/target", "/grid/prediction/1", "/camera/front/image", "/tf"} <= topics


def test_inputs_are_moved_for_a_row_without_translation_too_as_the_help_says(here):
    assert "also those of a row without translation" in " ".join(call("play", "--help").stdout.split())
    played = {}
    for row in ("BL-DC", "BL-NT"):
        call("play", "runs/first", row, "--out", f"{row}.mcap", "--logs", "logs")
        with Path(f"{row}.mcap").open("rb") as stream:
            found = make_reader(stream).iter_messages(["/grid/input/1/1/exact", "/grid/prediction/1/exact"])
            played[row] = {
                channel.topic.split("/")[2]: read_exact(message.data)[0].tobytes() for _, channel, message in found
            }
    assert played["BL-NT"]["input"] == played["BL-DC"]["input"] == played["BL-DC"]["prediction"]
    assert played["BL-NT"]["prediction"] != played["BL-NT"]["input"]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["runs/first", "BL-Sp"], 1, "Error: runs/first: there is no row 'BL-Sp', only BL-DC, BL-NT"),
        (["nowhere", "BL-DC"], 1, "Error: nowhere: is not the folder of a run: it has no run.json"),
        (["runs/first", "BL-DC", "--all", "--recording", "toy"], 2, "--recording names one recording"),
    ],
)
def test_a_users_mistake_is_told_without_a_traceback(here, capsys, arguments, code, message):
    with pytest.raises(SystemExit) as stop:
        main(["play", *arguments, "--out", "play.mcap"])
    assert stop.value.code == code
    assert message in capsys.readouterr().err.splitlines()[-1]
    assert not Path("play.mcap").exists()


@pytest.mark.parametrize("place", ["runs/first/run.json", "notes.md", "foreign.mcap"])
def test_what_is_no_earlier_play_log_is_not_replaced_unless_it_is_forced(here, capsys, place):
    for name in ("notes.md", "foreign.mcap"):
        Path(name).write_text("precious")
    before = Path(place).read_bytes()
    with pytest.raises(SystemExit) as stop:
        main(["play", "runs/first", "BL-DC", "--out", place])
    assert stop.value.code == 1
    assert capsys.readouterr().err.splitlines() == [
        f"Error: {place}: exists and is not a log of `play`; name another file, or replace it with --force"
    ]
    assert Path(place).read_bytes() == before
    if place != "runs/first/run.json":
        call("play", "runs/first", "BL-DC", "--out", place, "--force")
        call("play", "runs/first", "BL-NT", "--out", place)  # now it is one


def test_a_layout_that_somebody_changed_is_not_replaced_unless_it_is_forced(here):
    layout = Path("play.layout.json")
    layout.write_text("{}")
    for _ in range(2):
        with pytest.raises(
            InputError, match=r"play\.layout\.json: exists and is not a layout of `play`, or was changed"
        ):
            call("play", "runs/first", "BL-DC", "--out", "play.mcap")
        call("play", "runs/first", "BL-DC", "--out", "play.mcap", "--force")
        call("play", "runs/first", "BL-NT", "--out", "play.mcap")  # written by `play`, so it goes with its log
        layout.write_text(layout.read_text().replace("Target", "mine"))


@pytest.mark.parametrize("place", ["logs/play.mcap", "logs/val/play.mcap", "logs/new/play.mcap", "others/play.mcap"])
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_no_play_log_is_put_among_logs(here, place, force):
    Path("others").mkdir()
    Path("others/toy.mcap").write_bytes(Path("logs/val/toy.mcap").read_bytes())
    with pytest.raises(InputError, match="lies in a folder of logs, where it would be taken for one"):
        call("play", "runs/first", "BL-DC", "--out", place, *force)
    assert not Path(place).exists()
