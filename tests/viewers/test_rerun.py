"""A played log as Rerun reads it: sound, and every grid a picture."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.small_runs import run, write_logs

from semgrid_eval.playback.write import Play, write_playback

RERUN = shutil.which("rerun") or shutil.which("rerun", path=Path(sys.executable).parent)
pytestmark = pytest.mark.skipif(RERUN is None, reason="no `rerun` is installed (the extra `viewers`)")
PICTURES = ("legend", "target/picture", "prediction/1/picture", "prediction/2/picture", "certainty/2/picture")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rerun")
    rows = [{"name": "newest", "model": "newest"}, {"name": "table", "model": "table"}]
    run(rows, write_logs(folder / "logs"), folder / "run")
    play = Play(folder / "run", ("newest", "table"), folder / "logs", grids=folder / "grids")
    return write_playback(play, folder / "play.mcap").log


def rerun(*arguments):
    done = subprocess.run([RERUN, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_log_is_sound_channel_by_channel(log):
    lines = re.findall(r"^(\w+) +\d+ +\d+  (/\S+)", rerun("mcap", "check", log), re.MULTILINE)
    assert {state for state, _ in lines} == {"ok"}
    assert {f"/grid/{name}" for name in PICTURES} <= {topic for _, topic in lines}


def test_every_grid_becomes_an_image(log, tmp_path):
    rerun("mcap", "convert", log, "-o", tmp_path / "play.rrd")
    chunks = rerun("rrd", "print", tmp_path / "play.rrd").splitlines()
    images = {re.search(r" - (/\S+) - ", line)[1] for line in chunks if "EncodedImage:blob" in line}
    assert {f"/grid/{name}" for name in (*PICTURES, "input/1/1/picture")} <= images
    assert {"/camera/front/image", "/camera/front/label"} <= images
