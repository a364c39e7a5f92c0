"""Class sets where files and configurations name them."""

from pathlib import Path

from semgrid_eval.classes import DEFAULT_CLASSES, DEFAULT_FILE, ClassSet, load_classes
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, located


def with_classes(grid: object, beside: Path, field: str) -> object:
    """Put the class set of a file in the place of its path, which is relative to the file `beside` that names it.

    A grid's configuration that names no file is returned as it is.

    Raises:
        ConfigError: names both files, the field and what is wrong.
    """
    if not isinstance(grid, dict) or not isinstance(grid.get("classes"), str):
        return grid
    with located(path=beside, field=field, kind=ConfigError):
        found = load_classes(beside.parent / grid["classes"])
    return grid | {"classes": found.model_dump(mode="json")}


def classes_of_grid(grid: object, place: str) -> ClassSet:
    """Return the classes that a grid's configuration, as JSON has it, asks for; `place` is where it stands.

    Raises:
        ConfigError: they are not a class set.
    """
    named = grid.get("classes") if isinstance(grid, dict) else None
    return DEFAULT_CLASSES if named is None else parse_config(ClassSet, named, path=f"{place}: grid.classes")


def default_classes_text() -> str:
    """Return the file of the default class set, to copy."""
    return DEFAULT_FILE.read_text(encoding="utf-8")
