"""The commands of pages run one after the other."""

import re
from pathlib import Path

import pytest
from support.cityscapes_tree import Tree
from support.commands import run_command
from support.onnx_models import colour_network
from support.page_runs import run, toy_logs
from support.pages import blocks, text_of

SHORTER = ("epochs: 8, updates_per_epoch: 150, batch: 8, schedule: {drop_epoch: 6}", "epochs: 1, updates_per_epoch: 2")


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
@pytest.mark.slow
def test_tour(workplace, page):
    run(page)
    assert Path("runs/first/report/index.html").is_file()
    assert Path("play.mcap").is_file() == (page == "docs/index.md")


@pytest.mark.slow
def test_own_data(workplace):
    for frame in Tree(Path("SRC"), size=(128, 64)).write(range(30)):
        Path("PREDICTIONS").mkdir(exist_ok=True)
        Path(f"PREDICTIONS/{frame}_labels.png").write_bytes(Tree(Path("SRC"), size=(128, 64)).label())
    toy_logs("recordings")
    Path("runs/paper/trainings").mkdir(parents=True)
    colour_network(Path("network.onnx"), colours={0: (0.5, 0.5, 0.5), 11: (1.0, 0.0, 0.0)})
    run("docs/own-data.md")
    assert len(list(Path("labelled").rglob("*.mcap"))) == 1


@pytest.mark.slow
def test_own_model(workplace):
    import torch

    toy_logs("logs")
    for block in blocks("python", text_of("docs/own-model.md")):
        Path(re.match(r"# (\S+)", block)[1]).write_text(block)
    torch.save({"layer.weight": torch.rand(10, 10, 5, 5), "layer.bias": torch.zeros(10)}, "mine.pt")
    (matrix,) = blocks("yaml", text_of("docs/own-model.md"))
    assert SHORTER[0] in matrix
    Path("small.yaml").write_text(matrix.replace(*SHORTER).replace("repeats: 3", "repeats: 1"))
    run("docs/own-model.md")
    assert len(list(Path("runs/small/results").iterdir())) == 3


@pytest.mark.slow
def test_report_and_playback(workplace):
    toy_logs("logs")
    assert run_command(["run", "baselines", "--logs", "logs", "--out", "runs/first"]).code == 0
    run("docs/report.md")
    named = set(re.findall(r"^\| `([^`]+)`", text_of("docs/report.md"), re.MULTILINE))
    assert named <= {path.name + "/" * path.is_dir() for path in Path("runs/first/report").iterdir()}
    run("docs/playback.md")
    assert Path("play.layout.json").is_file()


@pytest.mark.slow
def test_shell_and_gate(workplace):
    toy_logs("logs", ("train", "val", "val"))
    for name in ("first", "before", "after"):
        ended = run_command(["run", "baselines", "--logs", "logs", "--out", f"runs/{name}", "--row", "BL-*C"])
        assert ended.code == 0, ended.err
    town = Path("logs/.towns/town-0123456789abcdef")
    town.mkdir(parents=True)
    (town / "town.json").write_text("{}")
    run("docs/shell.md")
    assert len(list(Path("runs/first/grids").glob("*.npz"))) == 2  # those of a run that is named stay
    run("docs/gate.md")
    assert Path("page/index.html").is_file()


def test_check(workplace):
    toy_logs("logs")
    Path("recording.yaml").write_text(blocks("yaml", text_of("docs/check.md"))[0])
    run("docs/check.md")


@pytest.mark.slow
def test_disturbances(workplace):
    toy_logs("LOGS")  # in place of the frozen data set, which has one size
    run("docs/disturbances.md", but="convert town-v1")
    assert Path("RUN/report/tables/disturbances.md").is_file()


@pytest.mark.slow
def test_latency_and_streaming(workplace):
    run("docs/streaming.md")
    Path("drives").rename("logs")
    run("docs/latency.md")
    assert Path("runs/stream/report/index.html").is_file()
