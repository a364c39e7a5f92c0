"""Class sets that are not the default one."""

from collections.abc import Sequence

from support.pages import blocks, text_of

from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import parse_config

PAGE = text_of("docs/classes.md")
FILE, MATRIX = blocks("yaml", PAGE)
"""The class set of the page, of five classes, and the matrix that names it."""


def class_set(*classes: dict, categories: Sequence[dict]) -> ClassSet:
    """Make a set of known classes, black if they do not say otherwise."""
    black = {"colour": [0, 0, 0]}
    entries = [{"name": "unknown", **black}, *({**black, **each} for each in classes)]
    return parse_config(ClassSet, {"categories": list(categories), "classes": entries})


def merged(*groups: tuple[str, ...]) -> tuple[ClassSet, list[int]]:
    """Merge classes of the default set, each group to one class of a category of its own, later ones drawn over.

    Returns the set, and the id in it of each default class; that of those in no group is unknown.
    """
    labels = {entry.name: list(entry.labels) for entry in DEFAULT_CLASSES.classes}
    names = [f"group{i}" for i in range(len(groups))]
    classes = [
        {"name": f"class{i}", "category": name, "labels": [label for each in group for label in labels[each]]}
        for i, (name, group) in enumerate(zip(names, groups, strict=True))
    ]
    places = [
        next((i for i, group in enumerate(groups, start=1) if name in group), 0) for name in DEFAULT_CLASSES.names
    ]
    assert len(places) == CLASS_COUNT
    return class_set(*classes, categories=[{"name": name} for name in names]), places
