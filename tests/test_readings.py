"""`docs/readings.md` answers every "reading N" that the package cites."""

import re
from pathlib import Path

import semgrid_eval

PACKAGE = Path(semgrid_eval.__file__).parent
PAGE = (Path(__file__).parents[1] / "docs/readings.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (\d+)\. [^\n]+\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
_CITED = re.compile(r"\breadings? (\d+)((?:, \d+)*)(?: (and|to) (\d+))?")


def cited_in(text):
    """Return the numbers that a text cites: `reading 9`, `readings 8, 9 and 11`, `readings 4 to 7`."""
    found = set()
    for first, middle, word, last in _CITED.findall(text):
        found |= {int(first), *map(int, re.findall(r"\d+", middle))}
        if word:
            found |= set(range(int(first), int(last) + 1)) if word == "to" else {int(last)}
    return found


def test_all_forms_of_citing_are_found():
    text = "(reading 3) (readings 8, 9 and 11). As reading 12 says; readings 14 to 17."
    assert cited_in(text) == {3, 8, 9, 11, 12, 14, 15, 16, 17}


def test_every_reading_that_the_package_cites_is_on_the_page():
    cited = {
        (number, path.name)
        for path in PACKAGE.rglob("*")
        if path.suffix in (".py", ".yaml")
        for number in cited_in(path.read_text(encoding="utf-8"))
    }
    assert len(cited) > 20
    assert [entry for entry in sorted(cited) if str(entry[0]) not in SECTIONS] == []


def test_readings_are_numbered_without_gaps_and_each_has_question_choice_and_switch():
    assert list(SECTIONS) == [str(number + 1) for number in range(23)]
    for text in SECTIONS.values():
        assert re.findall(r"\*\*(\w+)\.\*\*", text) == ["Question", "Choice", "Switch"]


def test_the_table_leads_to_every_reading():
    rows = re.findall(r"^\| \[(\d+)\]\(#([^)]+)\)", PAGE, re.MULTILINE)
    titles = re.findall(r"^## (.+)$", PAGE, re.MULTILINE)
    anchors = [re.sub(r"[^\w -]", "", title).lower().replace(" ", "-") for title in titles]
    assert rows == [(str(place + 1), anchor) for place, anchor in enumerate(anchors)]
