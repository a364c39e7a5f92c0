"""The classes of a semantic grid as one set: names, categories, priorities, colours, and the way from labels to them.

Which classes labels become is a choice of the evaluation: the default set is the paper's ten (reading 21), and a grid's
configuration may have another one.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.faults import meant, not_one_of, shown
from semgrid_eval.labels import CITYSCAPES_LABELS, LABEL_ID

NO_POINT = 255  # value of the class map for labels that give no point at all: sky, the ego vehicle, void
UNKNOWN = 0
"""The id of `unknown`, what no sensor has seen, in every set."""
MASK_COLOUR = (255, 255, 255)
_UNKNOWN_NAME = "unknown"
T = TypeVar("T")


def _label(value: object) -> object:
    """Check a label of a class: the name of one of Cityscapes', or an id that label images have."""
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise ValueError(f"must be the name of a label or its id, not {shown(value)}")
    if isinstance(value, int) and not 0 <= value <= 255:
        raise ValueError(f"label ids are 0 to 255, not {value}")
    if isinstance(value, str) and value not in LABEL_ID:
        raise ValueError(f"{value!r} is not a Cityscapes label{meant(value, LABEL_ID)}")
    return value


Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Label = Annotated[str | int, BeforeValidator(_label)]
Channel = Annotated[int, Field(ge=0, le=255)]
Colour = tuple[Channel, Channel, Channel]
Side = Annotated[int, Field(ge=1, le=16)]


class Category(Config):
    """Classes that are scored together; its place in the list is the priority by which its classes are drawn."""

    name: Name  # lower-case letters, digits and `_`; no class has the same
    # Sides of dilation, erosion, erosion and dilation, by which morphology filters each of its classes (reading 12);
    # from 1, which changes nothing, to 16. Those of the paper's small and moving classes if not given.
    kernels_cells: tuple[Side, Side, Side, Side] = (1, 1, 2, 2)
    # Whether its classes move by themselves, and how fast: like vehicles or like persons. Not at all if not given.
    moves: Literal["slow", "fast"] | None = None


class GridClass(Config):
    """A class; its id in grids is its place in the list."""

    name: Name  # lower-case letters, digits and `_`
    category: Name | None = None  # of `unknown` alone it may be left out: then that is in no category
    colour: Colour  # sRGB, 0 to 255
    safe_colour: Colour | None = None  # for readers with any kind of colour blindness; `colour` if not given
    labels: tuple[Label, ...] = ()  # Cityscapes' names, or ids; each in one class at most, the others give no point
    # Which of the classes in a cell is drawn: that of the highest. By default the place of its category, from 1.
    priority: int | None = Field(None, ge=1, le=255)


class ClassSet(Config):
    """Classes with their categories. The first class is `unknown`; it has no labels, and whatever is seen covers it."""

    categories: tuple[Category, ...] = Field(min_length=1, max_length=16)  # later ones are drawn over earlier ones
    classes: tuple[GridClass, ...] = Field(min_length=2, max_length=64)  # by id

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.names[0] != _UNKNOWN_NAME:
            raise ValueError(f"classes.0.name: {self.names[0]!r} is not {_UNKNOWN_NAME}, which has to be the first")
        self._check_names()
        for number, entry in enumerate(self.classes):
            self._check(f"classes.{number}", entry)
        for number, name in enumerate(self.category_names):
            if not self.known_members(name):
                raise ValueError(f"categories.{number}.name: no class is in {name}")
        label_ids = self._label_ids()
        if (twice := _repeated(label for labels in label_ids for label in labels)) is not None:
            names = [entry.name for entry, ids in zip(self.classes, label_ids, strict=True) if twice in ids]
            raise ValueError(f"classes: the label {_label_words(twice)} is mapped twice, to {' and '.join(names)}")
        return self

    def _check_names(self) -> None:
        """Refuse names that would stand for two columns of a table."""
        known = known_name(self.classes[UNKNOWN].category or "")
        figures = (MEAN_KNOWN, known, *(f"merged_{name}" for name in (*self.category_names, known)))
        owners = dict.fromkeys(figures, "figure")
        for kind, names in (("category", self.category_names), ("class", self.names)):
            for number, name in enumerate(names):
                if name in owners:
                    place = f"{_LISTS[kind]}.{number}.name"
                    raise ValueError(f"{place}: {name!r} is the name of a {owners[name]} already")
                owners[name] = kind

    def _check(self, place: str, entry: GridClass) -> None:
        is_unknown = entry.name == _UNKNOWN_NAME
        if entry.category is None and not is_unknown:
            raise ValueError(f"{place}.category: is missing; it is one of {', '.join(self.category_names)}")
        if entry.category is not None and entry.category not in self.category_names:
            raise ValueError(f"{place}.category: {not_one_of(entry.category, self.category_names)}")
        if not entry.labels and not is_unknown:
            raise ValueError(f"{place}.labels: are missing: no label becomes {entry.name}")
        if is_unknown and (entry.labels or entry.priority is not None):
            raise ValueError(f"{place}: {_UNKNOWN_NAME} has neither labels nor a priority: it is what nobody has seen")

    def _label_ids(self) -> list[list[int]]:
        return [[LABEL_ID[each] if isinstance(each, str) else each for each in entry.labels] for entry in self.classes]

    def identity(self) -> dict[str, object]:
        """Return what determines grids and scores, as JSON values: all but the colours in which classes are shown."""
        return self.model_dump(mode="json", exclude={"classes": {"__all__": {"colour", "safe_colour"}}})

    def means(self, other: "ClassSet") -> bool:
        """Tell whether another set differs from this one in colours at most."""
        return self == other or self.identity() == other.identity()

    @property
    def names(self) -> tuple[str, ...]:
        """Names by id."""
        return tuple(entry.name for entry in self.classes)

    @property
    def count(self) -> int:
        """How many classes there are, C, `unknown` among them."""
        return len(self.classes)

    @property
    def known(self) -> tuple[int, ...]:
        """Ids of all classes but `unknown`."""
        return tuple(range(1, self.count))

    @property
    def category_names(self) -> tuple[str, ...]:
        """Names of the categories in ascending priority."""
        return tuple(category.name for category in self.categories)

    def members(self, *categories: str) -> tuple[int, ...]:
        """Return the ids of the classes that are in any of some categories."""
        return tuple(i for i, entry in enumerate(self.classes) if entry.category in categories)

    def known_members(self, *categories: str) -> tuple[int, ...]:
        """Return those of them that are not `unknown`."""
        return tuple(i for i in self.members(*categories) if i != UNKNOWN)

    @property
    def background(self) -> tuple[int, ...]:
        """Ids of the known classes of the first category, over which all others are drawn."""
        return self.known_members(self.category_names[0])

    @property
    def movable(self) -> tuple[int, ...]:
        """Ids of the classes that move by themselves."""
        return self.known_members(*(category.name for category in self.categories if category.moves))

    @property
    def fast(self) -> tuple[int, ...]:
        """Ids of those that move fast."""
        return self.known_members(*(category.name for category in self.categories if category.moves == "fast"))

    @property
    def averaged(self) -> Mapping[str, tuple[int, ...]]:
        """Ids of the classes behind each mean: of categories, also without `unknown` where it is in one, and of all."""
        found: dict[str, tuple[int, ...]] = {}
        for name in self.category_names:
            found[name] = self.members(name)
            if UNKNOWN in found[name]:
                found[known_name(name)] = self.known_members(name)
        return {**found, MEAN_KNOWN: self.known}

    def kernels_cells(self, class_id: int) -> tuple[int, int, int, int]:
        """Return the sides of the kernels by which a known class is filtered."""
        return next(each.kernels_cells for each in self.categories if each.name == self.classes[class_id].category)

    def priorities(self) -> NDArray[np.uint8]:
        """Return the drawing priority (C,) of each class, 0 of `unknown`."""
        places = {name: place for place, name in enumerate(self.category_names, start=1)}
        values = [entry.priority or places.get(entry.category or "", 0) for entry in self.classes]
        return np.array([0, *values[1:]], np.uint8)

    def palette(self, *, safe: bool = False) -> NDArray[np.uint8]:
        """Return the sRGB palette (C, 3): the colours of the classes, or those that are colour-blind-safe."""
        return np.array([(entry.safe_colour if safe else None) or entry.colour for entry in self.classes], np.uint8)

    def class_by_label(self) -> NDArray[np.uint8]:
        """Return the table (256,) from label id to class id, `NO_POINT` where a label gives no point."""
        table = np.full(256, NO_POINT, np.uint8)
        for class_id, labels in enumerate(self._label_ids()):
            table[labels] = class_id
        return table


MEAN_KNOWN = "mean_known"
"""The figure that is the mean over all known classes."""
_LISTS = {"category": "categories", "class": "classes"}


def known_name(category: str) -> str:
    """Return what the figure of a category is called that leaves `unknown` out."""
    return f"{category}_known"


def _repeated(values: Iterable[T]) -> T | None:
    value, count = Counter(values).most_common(1)[0]
    return value if count > 1 else None


def _label_words(label_id: int) -> str:
    return next((label.name for label in CITYSCAPES_LABELS if label.label_id == label_id), str(label_id))


def load_classes(path: Path | str) -> ClassSet:
    """Read a class set from a YAML file.

    Raises:
        ConfigError: names the file, the field and what is wrong with its value.
    """
    return parse_config(ClassSet, load_yaml(Path(path)), path=path)


DEFAULT_FILE = resources.files("semgrid_eval").joinpath("data/classes.yaml")
"""Where the default class set is written."""

with resources.as_file(DEFAULT_FILE) as _path:
    DEFAULT_CLASSES = load_classes(_path)
CLASS_NAMES = DEFAULT_CLASSES.names
CLASS_COUNT = DEFAULT_CLASSES.count
"""Of the default set: for the paper's tables and for whoever has no other."""
