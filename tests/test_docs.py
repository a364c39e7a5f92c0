"""What README shows is what the program does: commands parse, YAML loads, the model runs, links lead somewhere."""

import re
import shlex
from pathlib import Path

import click
import pytest
import torch
import yaml
from support.models import made, network
from support.toy_world import street

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.cli.main import cli
from semgrid_eval.log.store import write_log
from semgrid_eval.models.registry import find_model
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.windows.data import WindowBatch

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXPERIMENTS = [
    (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("remedies", "disturbances", "predictions")
]
LATENCY = (ROOT / "docs" / "latency.md").read_text(encoding="utf-8")


def blocks(language, page=README):
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def commands():
    shown = [block for page in (README, *EXPERIMENTS, LATENCY) for block in blocks("sh", page)]
    lines = [line.partition("#")[0].strip() for block in shown for line in block.splitlines()]
    return list(dict.fromkeys(line for line in lines if line.startswith("semgrid-eval ")))


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Everything that README's commands take as given."""
    monkeypatch.chdir(tmp_path)
    folders = ("SRC", "PREDICTIONS", "logs/val", "recordings", "runs/first", "runs/paper/trainings")
    for folder in (*folders, "LOGS/val", "RUN", "TREE/pred_sequence"):
        Path(folder).mkdir(parents=True)
    for file in ("logs/val/a.mcap", "network.onnx"):
        Path(file).touch()
    return tmp_path


@pytest.mark.parametrize("line", commands())
def test_commands_of_the_readme_parse(workplace, line):
    arguments = [part for word in shlex.split(line)[1:] for part in (sorted(map(str, Path().glob(word))) or [word])]
    command, context = cli, click.Context(cli)
    while isinstance(command, click.Group):
        name, *arguments = arguments
        command = command.get_command(context, name)
        assert command is not None, name
    command.make_context(name, arguments)


def test_matrices_of_the_readme_load(workplace):
    Path("small.py").write_text(blocks("python")[0])
    loaded = 0
    for block in blocks("yaml"):
        if "rows:" in block:
            Path("m.yaml").write_text(block)
            loaded += len(load_matrix("m.yaml").rows)
    assert loaded == 12


@pytest.mark.parametrize("page", EXPERIMENTS, ids=lambda page: page.partition("\n")[0])
def test_matrices_of_experiments_load(workplace, page):
    for block in blocks("yaml", page):
        Path("m.yaml").write_text(block)
        assert load_matrix("m.yaml").rows


def own_batch():
    past = torch.randint(0, CLASS_COUNT, (2, 1, 2, 16, 16), dtype=torch.uint8)
    empty = torch.zeros(2, 16, 16)
    return WindowBatch(past, ("full",), torch.zeros(2, 2, 2), torch.zeros(2, 2), empty, empty.bool())


def test_network_of_the_readme_gives_probabilities(tmp_path):
    (tmp_path / "small.py").write_text(blocks("python")[0])
    net = network(find_model(f"{tmp_path}/small.py:Small"), width=4)
    torch.testing.assert_close(net.predict(own_batch()).sum(dim=1), torch.ones(2, 16, 16))


def test_model_of_the_readme_loads_its_weights_and_gives_probabilities(tmp_path):
    (tmp_path / "mine.py").write_text(blocks("python")[1])
    keep = torch.nn.init.dirac_(torch.empty(CLASS_COUNT, CLASS_COUNT, 5, 5))  # each class stays where it is
    torch.save({"layer.weight": keep, "layer.bias": torch.zeros(CLASS_COUNT)}, tmp_path / "mine.pt")
    batch = own_batch()
    with torch.inference_mode():
        answer = made(find_model(f"{tmp_path}/mine.py:Mine")).predict(batch)
    assert torch.equal(answer.argmax(dim=1), batch.past[:, 0, -1].long())
    torch.testing.assert_close(answer.sum(dim=1), torch.ones(2, 16, 16))


def test_python_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(street(1, frames=26, noise_px=0.05).recording(), tmp_path / "logs" / "val" / "toy.mcap")
    shown = {}
    exec(blocks("python")[2], shown)
    assert shown["iou"]["road"] > 0.5
    assert set(shown["table"].row) >= {"BL-DC", "BL-Fuse"}
    assert Path("prediction.png").stat().st_size > 1000
    assert Path("runs/python/report/index.html").is_file()


@pytest.mark.parametrize(
    "page",
    [
        *("README.md", "ARCHITECTURE.md", "reports/README.md"),
        *("docs/performance.md", "docs/readings.md", "docs/town.md", "docs/remedies.md", "docs/disturbances.md"),
        *("docs/ceiling.md", "docs/network.md", "docs/model-card.md", "docs/check.md", "docs/latency.md"),
        *("docs/streaming.md", "docs/predictions.md"),
    ],
)
def test_links_and_files_that_a_page_names_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    links = [target for target in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in target]
    assert [link for link in links if not ((ROOT / page).parent / link).exists()] == []


def test_make_installs_extras_that_exist():
    extras = set(re.findall(r"\.\[([a-z,]+)\]", (ROOT / "Makefile").read_text())[0].split(","))
    declared = set(re.findall(r"^(\w+) = \[", (ROOT / "pyproject.toml").read_text(), re.MULTILINE))
    assert extras <= declared


def test_ci_calls_make_test():
    assert "make test" in (ROOT / ".ci" / "run").read_text()


def test_presets_named_in_the_readme_exist():
    named = re.search(r"Presets: ([a-z,\s-]+);", README)
    assert named is not None
    for name in named.group(1).split(","):
        assert load_matrix(name.strip()).rows


def test_yaml_blocks_are_yaml():
    for block in blocks("yaml"):
        assert yaml.safe_load(block)


def test_the_profile_that_the_page_on_latency_shows_is_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("profile.json").write_text(blocks("json", LATENCY)[0])
    shown = {}
    exec(blocks("python", LATENCY)[0], shown)
    assert shown["profile"].chain_ms("residual-town").tolist() == pytest.approx([38.4, 53.7])
