"""What a network's classes are among Cityscapes' labels: maps that ship with the package, and files of one's own."""

import os
import re
from dataclasses import dataclass
from importlib import resources
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.faults import meant, not_one_of, shown
from semgrid_eval.labels import CITYSCAPES_LABELS, LABEL_ID
from semgrid_eval.words import plural

CITYSCAPES, CITYSCAPES_IDS = "cityscapes", "cityscapes-ids"
_IN_FILES = ("mapillary", "ade20k")
NAMES = (CITYSCAPES, CITYSCAPES_IDS, *_IN_FILES)
"""Maps that ship with the package."""
_MOST = 255  # classes: the id 255 is void
_INDEX = re.compile(r"0|[1-9][0-9]{0,2}")
_UNLABELED = LABEL_ID["unlabeled"]


@dataclass(frozen=True)
class ClassMap:
    """The classes of a network, in the order of its outputs."""

    name: str
    classes: tuple[str, ...]
    labels: tuple[str, ...]  # the Cityscapes label of each

    @property
    def fewest(self) -> int:
        """How many outputs a network has at least: it may lack the last classes, if they are `unlabeled`."""
        return len(self.labels) - len(list(takewhile(lambda label: label == "unlabeled", reversed(self.labels))))

    def table(self) -> NDArray[np.uint8]:
        """Return the table (256,) from class to Cityscapes label id; what is no class is unlabeled."""
        table = np.full(256, _UNLABELED, np.uint8)
        table[: len(self.labels)] = [LABEL_ID[label] for label in self.labels]
        return table


class _File(Config):
    """A file of one's own, or one that ships."""

    base: str | None = None  # the map whose entries hold for all classes that are not named here
    classes: dict[str, str]  # a Cityscapes label by name or index; without base, names in the order of the outputs


def find_class_map(name: str) -> ClassMap:
    """Find a map that ships with the package, or read a file.

    Raises:
        ConfigError: there is no such map, or the file is malformed.
    """
    if name == CITYSCAPES:
        return _of_cityscapes(name, sorted((each.train_id, each.name) for each in CITYSCAPES_LABELS))
    if name == CITYSCAPES_IDS:
        return _of_cityscapes(name, [(each.label_id, each.name) for each in CITYSCAPES_LABELS])
    if name in _IN_FILES:
        with resources.as_file(resources.files("semgrid_eval.segmentation") / f"maps/{name}.yaml") as place:
            return _read(place, name)
    if os.path.lexists(name):  # what is not a file is refused as such
        return _read(Path(name), Path(name).stem)
    raise ConfigError(f"{name!r} is neither a file nor one of {', '.join(NAMES)}{meant(name, NAMES)}", field="classes")


def maps_of(count: int) -> list[str]:
    """Name the maps of the package that fit a network of so many classes."""
    found = {name: find_class_map(name) for name in NAMES}
    return [name for name, each in found.items() if each.fewest <= count <= len(each.labels)]


def _of_cityscapes(name: str, numbered: list[tuple[int, str]]) -> ClassMap:
    labels = tuple(label for number, label in numbered if number != _MOST)
    return ClassMap(name, labels, labels)


def _read(path: Path, name: str) -> ClassMap:
    file = parse_config(_File, load_yaml(path), path=path)
    for key, label in file.classes.items():
        if label not in LABEL_ID:
            raise ConfigError(not_one_of(label, LABEL_ID), path=path, field=f"classes.{key}")
    if file.base is not None:
        return _changed(path, name, file)
    if not 2 <= len(file.classes) <= _MOST:
        raise ConfigError(
            f"has {plural(len(file.classes), 'class', 'classes')}; 2 to {_MOST} are possible",
            path=path,
            field="classes",
        )
    classes = _in_order(path, file)
    return ClassMap(name, classes, tuple(file.classes[each] for each in classes))


def _in_order(path: Path, file: _File) -> tuple[str, ...]:
    """Return the classes in the order of outputs: as they stand there, or by their indices."""
    indices = [int(key) for key in file.classes if _INDEX.fullmatch(key)]
    if not indices:
        return tuple(file.classes)
    if len(indices) != len(file.classes):
        named = next(key for key in file.classes if not _INDEX.fullmatch(key))
        fault = f"{shown(named)} is a name beside indices; without base, all are names, or all are indices"
        raise ConfigError(fault, path=path, field="classes")
    if gaps := set(range(len(indices))) - set(indices):
        raise ConfigError(f"index {min(gaps)} is missing", path=path, field="classes")
    return tuple(map(str, range(len(indices))))


def _changed(path: Path, name: str, file: _File) -> ClassMap:
    """Put the entries of a file over those of its base."""
    if file.base not in NAMES:
        raise ConfigError(not_one_of(file.base, NAMES), path=path, field="base")
    base = find_class_map(file.base)
    labels = dict(zip(base.classes, base.labels, strict=True))
    for key, label in file.classes.items():
        found = base.classes[int(key)] if _INDEX.fullmatch(key) and int(key) < len(base.classes) else key
        if found not in labels:
            raise ConfigError(f"{file.base}: {not_one_of(key, base.classes)}", path=path, field="classes")
        labels[found] = label
    return ClassMap(name, base.classes, tuple(labels.values()))
