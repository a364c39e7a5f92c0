"""Every bad input found so far ends in its line; `expected.json` of each kind holds them, and `...` is any rest."""

import json

import pytest
from support.fuzzing import CORPUS, READERS

from semgrid_eval.errors import SemgridError

LINES = {kind: json.loads((CORPUS / kind / "expected.json").read_text()) for kind in READERS}
BAD = [(kind, name) for kind, lines in LINES.items() for name in lines]


@pytest.mark.parametrize(("kind", "name"), BAD, ids=["/".join(each) for each in BAD])
def test_a_bad_input_ends_in_its_line(kind, name):
    path = CORPUS / kind / name
    with pytest.raises(SemgridError) as raised:
        READERS[kind](path)
    line, expected = str(raised.value), f"{path}: {LINES[kind][name]}"
    assert "\n" not in line
    assert line.startswith(expected[:-3]) if expected.endswith("...") else line == expected


@pytest.mark.parametrize("kind", READERS)
def test_every_input_of_the_corpus_has_a_line(kind):
    found = {path.name for path in (CORPUS / kind).iterdir()} - {"expected.json"}
    assert found == LINES[kind].keys()
    assert all(path.stat().st_size < 1 << 15 for path in (CORPUS / kind).iterdir())
