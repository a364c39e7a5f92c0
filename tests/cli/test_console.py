"""How much a command says: usually, with -q and with -v; and patterns in place of the names of logs."""

import io
import re

import click
import pytest
from click.testing import CliRunner
from support.cityscapes_tree import Tree

from semgrid_eval.cli.console import progress
from semgrid_eval.cli.main import COMMANDS, cli
from semgrid_eval.sources.known import SOURCES


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Two recordings, of which one is faulty."""
    monkeypatch.chdir(tmp_path)
    tree = Tree(tmp_path / "tree")
    Tree(tree.root, city="bonn").write(range(2))
    Tree(tree.root, city="berlin").write(range(2))
    tree.disparity(tree.write(range(2))[0]).unlink()
    return tree


def said(*arguments):
    done = CliRunner().invoke(cli, [*arguments, "--workers", "1"] if arguments[0] == "convert" else arguments)
    return done.stderr.splitlines()


def test_quiet_leaves_errors_alone_and_verbose_names_every_piece_of_work(tree):
    usual = said("convert", "cityscapes", "tree", "usual")
    error = next(line for line in usual if line.startswith("Error: "))
    assert "usual: 2 written, 0 up to date, 1 failed" in usual
    assert usual[-1].startswith("4 of 4 frames have no labels: ")
    assert said("convert", "cityscapes", "tree", "quiet", "-q") == [error]
    verbose = said("convert", "cityscapes", "tree", "verbose", "--verbose")
    for done, name in enumerate(("aachen", "berlin", "bonn"), start=1):
        assert f"convert: {done}/3 val/{name}_000000_000000" in verbose
    assert [line for line in usual if "/3" in line] != [line for line in verbose if "/3" in line]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_what_a_stage_waits_for_has_a_bar_below_it(monkeypatch):
    shown = Terminal()
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    with click.Context(cli), progress("score a") as outer:
        outer(1, 2, "first")
        with progress("gather") as inner:
            inner(3, 3, "last")
        outer(2, 2)
    lines = re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.getvalue()))
    score, gather = [line for line in lines if line.strip()][-2:]
    assert re.search(r"score a .* 2/2", score)
    assert re.search(r"gather .* 3/3 .* last", gather)
    assert shown.getvalue().count("\x1b[?25l") == 1, "one display hides the cursor"


def test_warnings_are_said_with_quiet(tree):
    said("convert", "cityscapes", "tree", "logs")
    tree.write(range(2))
    (tree.root.parent / "logs" / "val" / "bonn_000000_000000.mcap").rename(tree.root.parent / "logs/val/other.mcap")
    (warning,) = said("convert", "cityscapes", "tree", "logs", "--quiet")
    assert warning.startswith("Warning: logs holds 1 log beside those of this conversion")


def test_quiet_and_verbose_exclude_each_other(tree):
    assert said("check", "tree", "-q", "-v")[-1] == "Error: --quiet and --verbose exclude each other"


@pytest.mark.parametrize(
    "words", [*((name,) for name in COMMANDS if name != "convert"), *(("convert", s) for s in SOURCES)]
)
def test_every_command_that_works_can_be_quiet_or_verbose(words):
    shown = CliRunner().invoke(cli, [*words, "--help"]).output
    assert "-q, --quiet" in shown
    assert "-v, --verbose" in shown


def test_a_pattern_takes_the_place_of_names_of_logs_each_once(tree):
    said("convert", "cityscapes", "tree", "logs")
    named = ("logs/val/berlin_000000_000000.mcap", "logs/val/bonn_000000_000000.mcap")
    by_name = CliRunner().invoke(cli, ["check", *named])
    for pattern in (
        ("logs/val/b*.mcap",),
        ("logs/**/b*.mcap", named[0]),
        (str(tree.root.parent / "logs/v?l/b*.mcap"),),
    ):
        by_pattern = CliRunner().invoke(cli, ["check", *pattern])
        assert by_pattern.stderr.splitlines()[-1] == by_name.stderr.splitlines()[-1] == "2 logs checked, 0 with errors"
        assert by_pattern.stdout.replace(f"{tree.root.parent}/", "") == by_name.stdout
    assert said("check", "logs/x*.mcap")[-1] == "Error: Invalid value for 'LOG...': Nothing matches 'logs/x*.mcap'."
    assert said("check", "x.mcap")[-1] == "Error: Invalid value for 'LOG...': Path 'x.mcap' does not exist."


def test_a_log_whose_name_has_signs_of_a_pattern_is_itself(tree):
    said("convert", "cityscapes", "tree", "logs")
    log = tree.root.parent / "logs/val/bonn_000000_000000.mcap"
    log.rename(log.with_name("b[1].mcap"))
    assert said("check", "logs/val/b[1].mcap")[-1] == "1 log checked, 0 with errors"
