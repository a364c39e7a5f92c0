"""Counts with their nouns."""

import pytest

from semgrid_eval.words import plural


@pytest.mark.parametrize(("count", "text"), [(0, "0 logs"), (1, "1 log"), (2, "2 logs"), (1001, "1,001 logs")])
def test_a_noun_agrees_with_its_count(count, text):
    assert plural(count, "log") == text


def test_a_plural_may_be_another_word():
    assert [plural(count, "class", "classes") for count in (1, 2)] == ["1 class", "2 classes"]
