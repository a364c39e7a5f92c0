"""The page and the corpus are of the same inputs, and all kinds are tested."""

import re
from pathlib import Path

from support.bad import cityscapes, logs
from support.bad.checked import TEXT
from support.bad.known import KINDS
from support.bad.page import row_of

COUNT = sum(len(kind.inputs) for kind in KINDS)


def test_the_page_has_each_input_once_and_no_other():
    assert TEXT.count("\n| ") - TEXT.count("\n| bad input |") == COUNT
    assert [bad.words for kind in KINDS for bad in kind.inputs if not row_of(TEXT, kind, bad).startswith("| ")] == []
    assert f"This page holds {COUNT} bad inputs" in TEXT


def test_there_are_as_many_as_are_promised_and_each_is_another():
    assert COUNT >= 250
    for kind in KINDS:
        assert len({bad.words for bad in kind.inputs}) == len(kind.inputs)
        same = {(bad.command, tuple(bad.files.items()), bad.spoil) for bad in kind.inputs}
        assert len(same) == len(kind.inputs)


def test_every_kind_is_run_by_a_test():
    asked = "\n".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    modules = {path.stem for path in (Path(__file__).parents[1] / "support" / "bad").glob("*.py")}
    kinds = {name for name in modules if re.search(rf"cases\(.*\b{name}\.", asked)}
    assert modules - kinds == {"__init__", "case", "checked", "json_files", "known", "page", "small"}


def test_lines_are_in_words_of_ours():
    lines = re.findall(r"^\| .* \| `+(.*?)`+ \|$", TEXT, re.MULTILINE)
    assert len(lines) == COUNT
    poor = r"Input should|Field required|(?<!\| )\bNone\b|Traceback|Errno|object at 0x|validation error|pydantic|<class"
    assert [line for line in lines if re.search(poor, line)] == []


def test_every_file_of_the_corpus_is_used():
    for folder, words in ((logs.FOUND, logs.FOUND_WORDS), (cityscapes.PNGS, cityscapes.PNG_WORDS)):
        assert {path.stem for path in folder.iterdir()} == words.keys()
        assert all(path.stat().st_size < 1 << 15 for path in folder.iterdir())
