"""What the tests of bad inputs have in common."""

import pytest
from support.bad.case import Bad, Kind, outcome
from support.bad.page import PAGE, row, row_of, versions

TEXT = PAGE.read_text(encoding="utf-8")


def cases(*kinds: Kind) -> pytest.MarkDecorator:
    """Run a test with each bad input of these kinds."""
    found = [(kind, bad) for kind in kinds for bad in kind.inputs]
    return pytest.mark.parametrize(("kind", "bad"), found, ids=[f"{kind.title}: {bad.words}" for kind, bad in found])


def ends_in_its_line(kind: Kind, bad: Bad) -> None:
    """Make sure that a bad input ends in the line that the page says, and leaves everything as it was."""
    found = outcome(kind, bad)
    assert found.code > 0
    assert len(found.errors) == 1, found.errors
    assert found.other == []
    assert (found.changed, found.partial) == ([], [])
    if versions() in " ".join(TEXT.split()):
        assert row(kind, bad, found.errors[0]) == row_of(TEXT, kind, bad)
