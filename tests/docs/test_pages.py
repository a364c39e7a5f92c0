"""What pages show is what the program does: commands parse, matrices load, Python runs, links lead somewhere."""

import re
import shlex
from pathlib import Path

import click
import pytest
import torch
import yaml
from support.models import made, network
from support.pages import DOCS, PAGES, ROOT, blocks, commands, name_of, text_of
from support.toy_world import street

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.cli.main import cli
from semgrid_eval.log.store import write_log
from semgrid_eval.models.registry import find_model
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.windows.data import WindowBatch

README, OWN_MODEL, LATENCY = text_of("README.md"), text_of("docs/own-model.md"), text_of("docs/latency.md")
SHOWN = {line for page in PAGES for line in commands(page.read_text())}
LINES = sorted(line for line in SHOWN if line.startswith("semgrid-eval ") and "--help" not in line)
MORE = [ROOT / name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md", "reports/README.md")]
TAKEN_AS_GIVEN = (
    "SRC PREDICTIONS TREE/pred_sequence LOGS/val RUN logs/val drives/val recordings town runs/first runs/stream "
    "runs/before runs/after runs/own runs/paper/trainings back/run/trainings drive labelled runs/drive cityscapes "
    "varied real town-v1/small/val varied-town/trainings"
)


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Everything that the pages' commands take as given."""
    monkeypatch.chdir(tmp_path)
    for folder in TAKEN_AS_GIVEN.split():
        Path(folder).mkdir(parents=True)
    for file in ("logs/val/a.mcap", "network.onnx", "ade.onnx", "recording.yaml", "map.yaml", "m.yaml", "own.yaml"):
        Path(file).touch()
    return tmp_path


@pytest.mark.parametrize("line", LINES)
def test_commands_parse(workplace, line):
    arguments = [part for word in shlex.split(line)[1:] for part in (sorted(map(str, Path().glob(word))) or [word])]
    command, context = cli, click.Context(cli)
    while isinstance(command, click.Group):
        name, *arguments = arguments
        command = command.get_command(context, name)
        assert command is not None, name
    command.make_context(name, arguments)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_matrices_load_and_all_else_is_yaml(workplace, page):
    text = page.read_text()
    for number, block in enumerate(blocks("python", text)):
        for name in re.findall(r"^# (\w+\.py)$", block, re.MULTILINE) or [f"{number}.py"]:
            Path(name).write_text(block)
    for block in blocks("yaml", text):
        assert yaml.safe_load(block)
        if named := re.match(r"# (\w+\.yaml)\n", block):
            Path(named[1]).write_text(block)
        if "\nrows:" in f"\n{block}":
            Path("m.yaml").write_text(block)
            assert load_matrix("m.yaml").rows


def own_batch():
    past = torch.randint(0, CLASS_COUNT, (2, 1, 2, 16, 16), dtype=torch.uint8)
    empty = torch.zeros(2, 16, 16)
    return WindowBatch(past, ("full",), torch.zeros(2, 2, 2), torch.zeros(2, 2), empty, empty.bool())


def test_network_of_ones_own_gives_probabilities(tmp_path):
    (tmp_path / "small.py").write_text(blocks("python", OWN_MODEL)[0])
    net = network(find_model(f"{tmp_path}/small.py:Small"), width=4)
    torch.testing.assert_close(net.predict(own_batch()).sum(dim=1), torch.ones(2, 16, 16))


def test_model_of_ones_own_loads_its_weights_and_gives_probabilities(tmp_path):
    (tmp_path / "mine.py").write_text(blocks("python", OWN_MODEL)[1])
    keep = torch.nn.init.dirac_(torch.empty(CLASS_COUNT, CLASS_COUNT, 5, 5))  # each class stays where it is
    torch.save({"layer.weight": keep, "layer.bias": torch.zeros(CLASS_COUNT)}, tmp_path / "mine.pt")
    batch = own_batch()
    with torch.inference_mode():
        answer = made(find_model(f"{tmp_path}/mine.py:Mine")).predict(batch)
    assert torch.equal(answer.argmax(dim=1), batch.past[:, 0, -1].long())
    torch.testing.assert_close(answer.sum(dim=1), torch.ones(2, 16, 16))


@pytest.mark.slow
def test_python_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(street(1, frames=26, noise_px=0.05).recording(), tmp_path / "logs" / "val" / "toy.mcap")
    shown = {}
    exec(blocks("python", text_of("docs/python.md"))[0], shown)
    assert shown["iou"]["road"] > 0.5
    assert set(shown["table"].row) >= {"BL-DC", "BL-Fuse"}
    assert Path("prediction.png").stat().st_size > 1000
    assert Path("runs/python/report/index.html").is_file()


@pytest.mark.parametrize(
    "page",
    [*PAGES, *MORE],
    ids=name_of,
)
def test_links_and_files_that_a_page_names_exist(page):
    links = [target for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()) if "://" not in target]
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_page_is_in_the_contents_of_the_site_and_readme_stays_short():
    named = re.findall(r"([\w-]+\.md)", text_of("mkdocs.yml"))
    assert sorted(named) == [page.name for page in DOCS]
    assert len(README.splitlines()) <= 150


def test_make_installs_extras_that_exist():
    extras = {part for found in re.findall(r"\.\[([a-z,]+)\]", text_of("Makefile")) for part in found.split(",")}
    declared = set(re.findall(r"^(\w+) = \[", text_of("pyproject.toml"), re.MULTILINE))
    assert extras <= declared


def test_ci_calls_make_test():
    assert "make test" in text_of(".ci/run")


def test_presets_that_are_named_exist():
    named = re.search(r"Presets: ([a-z,\s-]+);", README)
    assert named is not None
    presets = text_of("docs/matrix.md").partition("| preset |")[2].partition("\n\n")[0]
    table = re.findall(r"^\| (`[^|]+) \|", presets, re.MULTILINE)
    in_table = {name for line in table for name in re.findall(r"`([a-z-]+)`", line)} | {"reference"}
    assert in_table == {name.strip() for name in named.group(1).split(",")}
    for name in in_table:
        assert load_matrix(name).rows


def test_the_profile_that_the_page_on_latency_shows_is_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("profile.json").write_text(blocks("json", LATENCY)[0])
    shown = {}
    exec(blocks("python", LATENCY)[0], shown)
    assert shown["profile"].chain_ms("residual-town").tolist() == pytest.approx([38.4, 53.7])
