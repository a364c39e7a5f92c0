"""Commands of pages that tell what was measured on whole data sets run on small ones, with trainings of two updates."""

import shlex
from pathlib import Path

import pytest
from support.cityscapes_tree import Tree, put
from support.commands import run_command
from support.page_runs import LESS, run, toy_logs
from support.pages import blocks, text_of

from semgrid_eval.scores.results import read_run

TRAINING = "training: {epochs: 1, updates_per_epoch: 2, batch: 2}"
SHORT = f"models: {{residual: {{{TRAINING}}}, ed: {{features: 4, {TRAINING}}}}}\n"
HELD_OUT = "defaults: {hold_out: [town03, town07, town11]}\n"  # which toy logs do not have
FROZEN = "convert town-v1"  # has one size; toy logs are in its place
pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def failures(run_folder):
    return {row.name: row.failure for row in read_run(Path(run_folder)).rows if row.failure}


def test_model_card():
    toy_logs("town")
    (matrix,) = blocks("yaml", text_of("docs/model-card.md"))
    assert "updates_per_epoch: 240" in matrix
    Path("any.yaml").write_text(SHORT + matrix.replace("updates_per_epoch: 240", "updates_per_epoch: 2"))
    run("docs/model-card.md", but=FROZEN, instead={"any/trainings/ID": "any/trainings/* shipped.safetensors"})
    assert Path("shipped.safetensors").stat().st_size < 2_500_000


def test_town():
    toy_logs("REAL")
    toy_logs("town")
    run("docs/town.md", but=FROZEN)
    assert list(Path("matched").rglob("*.mcap"))
    assert Path("run/report/index.html").is_file()


def named_matrices(page):
    """Return the matrices of a page by the file that their first line names."""
    begun = (block.partition("\n") for block in blocks("yaml", text_of(page)))
    return {first.removeprefix("# "): matrix for first, _, matrix in begun if first.startswith("# ")}


def test_ceiling():
    assert run_command(["convert", "synthetic", "town-v1/small", *shlex.split(LESS["convert synthetic"])]).code == 0
    (matrix,) = named_matrices("docs/ceiling.md").items()
    Path(matrix[0]).write_text(matrix[1])
    run("docs/ceiling.md")
    assert not failures("run")
    rows = read_run(Path("run")).rows
    assert sum(row.name.startswith("ceiling") for row in rows) == 10


def test_network():
    toy_logs("town-v1/small")
    toy_logs("real", ("val",))
    for file, matrix in named_matrices("docs/network.md").items():
        matrix = matrix.replace("training: {epochs: 5}", TRAINING).replace(HELD_OUT, "")
        Path(file).write_text(SHORT * ("models:" not in matrix and "extends: errors" not in matrix) + matrix)
    run("docs/network.md")
    for folder in ("run", "moves", "varied-town", "varied-real"):
        assert not failures(folder)
    recipe = {row.name: len(row.results) for row in read_run(Path("recipe")).rows}
    assert recipe["ED-DC-recipe"] == recipe["ED-DC"] == recipe["RN-DC"] == 1


def test_remedies():
    toy_logs("LOGS")
    tree = Tree(Path("TREE"))
    for name in tree.write(range(20)):
        put(Path(f"TREE/pred_sequence/{name}_labels.png"), tree.label())
    Path("REAL.yaml").write_text(next(text for text in blocks("yaml", text_of("docs/remedies.md"))))
    run("docs/remedies.md", but=FROZEN)
    assert not {name: reason for name, reason in failures("RUN").items() if name.startswith("BL")}
