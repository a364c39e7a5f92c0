import errno
import os
import shlex
import shutil

import pytest
from click.testing import CliRunner
from support.towns import SMALL, town_cache

from semgrid_eval.cli.main import cli, main
from semgrid_eval.log.fingerprint import fingerprint
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.benchmarks import BenchmarkSize, SplitSize, load_benchmark
from semgrid_eval.sources.known import load_source
from semgrid_eval.sources.town import convert, simulation
from semgrid_eval.sources.town.convert import versions

LABELS = ("train/town00_000000_000000", "val/town01_000001_000000")


def run(capsys, *arguments):
    """Run the command line; return its exit code and the lines on stderr."""
    with pytest.raises(SystemExit) as stopped:
        main(["convert", *(str(argument) for argument in arguments)])
    return stopped.value.code, capsys.readouterr().err.splitlines()


def tiny(fingerprints=None, made_with=None):
    """Make a benchmark of two recordings, one a split."""
    one, town = SplitSize(recordings=1, towns=1), {key: SMALL[key] for key in ("town_size_m", "duration_s")}
    size = BenchmarkSize(
        seed=SMALL["seed"], train=one, val=one, fingerprints=fingerprints, versions=made_with or versions()
    )
    changes = {"width": 128, "height": 64, **town, "sizes": {"small": size}}
    return load_benchmark("town-v1").model_copy(update=changes)


@pytest.fixture
def define(monkeypatch):
    """Return what replaces the benchmark by a tiny one."""
    return lambda *given: monkeypatch.setattr(convert, "load_benchmark", lambda name: tiny(*given))


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Logs of the tiny benchmark, rendered once in this process."""
    out = tmp_path_factory.mktemp("rendered")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(convert, "load_benchmark", lambda name: tiny())
        done = CliRunner().invoke(cli, ["convert", *benchmark_options(out, 1)])
    assert done.exit_code == 0, done.output
    return out, done.output


def benchmark_options(out, workers):
    return ["town-v1", str(out), "--cache", str(town_cache()), "--workers", str(workers)]


def published(out):
    return " ".join(fingerprint(out / f"{label}.mcap")[:8] for label in LABELS)


@pytest.mark.slow
def test_the_example_writes_logs_and_a_second_run_keeps_them_and_warns_of_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, *arguments = shlex.split(load_source("synthetic").example)
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert "2 written, 0 up to date, 0 failed" in done.output
    logs = find_logs(tmp_path / "logs")
    assert [log.parent.name for log in logs] == ["train", "val"]
    with LogReader(logs[0]) as log:
        assert log.scene.dataset == "synthetic"
        assert sum(1 for _ in log.frames("front")) == 30
        assert len(list(log.poses())) == 30
    assert "Warning" not in done.output
    before = [log.stat().st_mtime_ns for log in logs]
    for split in ("val", "test"):
        (tmp_path / "logs" / split).mkdir(exist_ok=True)
        shutil.copy(logs[0], tmp_path / "logs" / split / "another.mcap")
    again = CliRunner().invoke(cli, arguments)
    assert again.output.endswith(
        "logs: 0 written, 2 up to date, 0 failed\n"
        "Warning: logs holds 1 log beside those of this conversion, such as logs/val/another.mcap\n"
    )
    assert [log.stat().st_mtime_ns for log in logs] == before


def test_an_unpublished_benchmark_tells_its_digest_and_its_logs_carry_its_name(rendered):
    out, said = rendered
    assert "town-v1 small: digest " in said
    assert "nothing is published yet" in said
    logs = find_logs(out)
    assert [log.relative_to(out).with_suffix("").as_posix() for log in logs] == list(LABELS)
    with LogReader(logs[0]) as log:
        assert log.scene.dataset == "town-v1/small"


@pytest.mark.slow
def test_two_workers_elsewhere_render_the_published_bytes(rendered, define, tmp_path, capsys):
    out, _ = rendered
    define(published(out))
    code, lines = run(capsys, *benchmark_options(tmp_path, 2))
    assert code == 0
    assert lines[-1].endswith("as published")
    for label in LABELS:
        assert (tmp_path / f"{label}.mcap").read_bytes() == (out / f"{label}.mcap").read_bytes()


def test_an_interrupted_benchmark_goes_on_where_it_was(rendered, define, tmp_path, capsys):
    out, _ = rendered
    define(published(out))
    (tmp_path / "train").mkdir()
    shutil.copy(out / f"{LABELS[0]}.mcap", tmp_path / "train")
    code, lines = run(capsys, *benchmark_options(tmp_path, 1))
    assert code == 0
    assert f"{tmp_path}: 1 written, 1 up to date, 0 failed" in lines
    assert lines[-1].endswith("as published")


def test_recordings_that_differ_are_a_warning_that_names_versions(rendered, define, capsys):
    out, _ = rendered
    train, _ = published(out).split()
    define(f"{train} 00000000", {**versions(), "eclipse-sumo": "1.0"})
    code, lines = run(capsys, *benchmark_options(out, 1))
    assert code == 0
    assert lines[-1].startswith(
        "Warning: town-v1 small: 1 of 2 recordings differ from the published ones, such as val/"
    )
    assert f"published were made with eclipse-sumo 1.0 (here {versions()['eclipse-sumo']})" in lines[-1]


def test_logs_that_do_not_belong_are_a_warning(rendered, define, tmp_path, capsys):
    out, _ = rendered
    define(published(out))
    shutil.copytree(out, tmp_path, dirs_exist_ok=True)
    stray = tmp_path / "val/another.mcap"
    shutil.copy(out / f"{LABELS[0]}.mcap", stray)
    code, lines = run(capsys, *benchmark_options(tmp_path, 1))
    assert code == 0
    assert f"Warning: {tmp_path} holds 1 log beside those of this conversion, such as {stray}" in lines


@pytest.mark.slow
def test_the_benchmark_of_rigs_has_their_sensors(tmp_path, monkeypatch):
    def with_lidar(name):
        return tiny().model_copy(update={"name": name, "rig": "front+lidar"})

    monkeypatch.setattr(convert, "load_benchmark", with_lidar)
    _, *options = benchmark_options(tmp_path, 1)
    done = CliRunner().invoke(cli, ["convert", "town-rig-v1", *options])
    assert done.exit_code == 0, done.output
    with LogReader(tmp_path / f"{LABELS[0]}.mcap") as log:
        assert (log.scene.dataset, log.lidars) == ("town-rig-v1/small", ("top",))
        assert len(list(log.sweeps("top"))) == 17


def test_a_benchmark_has_no_options_that_would_change_it(tmp_path, capsys):
    code, lines = run(capsys, "town-v1", tmp_path, "--seed", 1)
    assert (code, lines[-1]) == (2, "Error: No such option '--seed'. Did you mean '--size'?")


def test_how_many_recordings_must_be_said(tmp_path, capsys):
    code, lines = run(capsys, "synthetic", tmp_path)
    assert (code, lines[-1]) == (2, "Error: Missing option '--recordings'.")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--width", "1000000"], "Error: --width: "),
        (["--towns", "1"], "Error: training and validation need different towns"),
        (["--duration-s", "0"], "Error: --duration-s: "),
        (["--val-towns", "0"], "Error: --val-towns: "),
    ],
)
def test_an_impossible_wish_is_one_line(option, message, tmp_path, capsys):
    code, lines = run(capsys, "synthetic", tmp_path, "--recordings", 2, *option)
    assert code == 1
    assert len(lines) == 1
    assert lines[0].startswith(message)


def test_a_failure_of_sumo_is_one_line_with_its_own_message(tmp_path, monkeypatch, capsys):
    tool = tmp_path / "sumo/bin/netgenerate"
    tool.parent.mkdir(parents=True)
    tool.write_text("#!/bin/sh\necho 'Error: the street is closed.' >&2\nexit 1\n")
    tool.chmod(0o755)
    monkeypatch.setattr(simulation, "sumo_home", lambda: tmp_path / "sumo")
    code, lines = run(capsys, "synthetic", tmp_path / "logs", "--recordings", 2, "--workers", 1)
    assert (code, lines) == (1, ["Error: SUMO's netgenerate failed with exit code 1: the street is closed."])
    assert list((tmp_path / "logs/.towns").iterdir()) == []


def test_a_disk_that_is_full_is_one_line_after_the_progress(define, tmp_path, monkeypatch, capsys):
    def fill(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    define()
    monkeypatch.setattr(os, "fsync", fill)
    code, lines = run(capsys, *benchmark_options(tmp_path, 1))
    assert code == 1
    assert [line for line in lines if not line.startswith("simulate: ")] == [
        f"Error: {tmp_path}/{LABELS[0]}.mcap: cannot be written: No space left on device; "
        "what is written is whole: make room, and the same command continues"
    ]


def test_a_temporary_folder_that_is_full_is_one_line(tmp_path, monkeypatch, capsys):
    def fill(**_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/tmp/semgrid-town-x")

    monkeypatch.setattr("semgrid_eval.sources.town.town.tempfile.TemporaryDirectory", fill)
    code, lines = run(capsys, "synthetic", tmp_path / "logs", "--recordings", 2, "--workers", 1)
    assert (code, lines) == (1, ["Error: /tmp/semgrid-town-x: No space left on device"])


@pytest.mark.parametrize("seed", [str(2**31), str(2**64), "9" * 5000])
def test_a_seed_that_no_generator_takes_is_one_line(seed, tmp_path, capsys):
    code, lines = run(capsys, "synthetic", tmp_path / "logs", "--recordings", 2, "--seed", seed)
    assert code in (1, 2)
    assert lines[-1].startswith("Error: ")
