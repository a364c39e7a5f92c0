"""What every source offers, and the sources that the command line offers, one line each."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from semgrid_eval.config import Config
from semgrid_eval.errors import MissingExtraError

if TYPE_CHECKING:  # it is heavy, and the help of the commands should not wait for it
    from semgrid_eval.log.convert import ConversionSummary, Work

C = TypeVar("C", bound=Config)


@dataclass(frozen=True)
class Source(Generic[C]):
    """What makes recordings, as the command line offers it.

    Each field of `options` is an option, described by its `description`; a path without default is an argument, and so
    are several of them (`tuple[Path, ...]`).
    """

    options: type[C]
    convert: "Callable[[C, Path, Work], ConversionSummary]"  # writes the logs OUT/<split>/<name>.mcap of what is chosen
    help: str  # what the command does
    example: str  # a use of the command
    inspect: Callable[[C], str] | None = None  # what --inspect does with what is given, and what it has to say
    cache: str = ""  # what the source keeps in the folder `Work.cache`, and where that is by default; empty if nothing


class Known(NamedTuple):
    """Where a `Source` is found, as `module:name`, and the extra of the package that it needs."""

    place: str
    extra: str = ""


SOURCES = {
    "cityscapes": Known("semgrid_eval.sources.cityscapes.tree:SOURCE"),
    "synthetic": Known("semgrid_eval.sources.town.convert:SOURCE", extra="synthetic"),
    "argoverse2": Known("semgrid_eval.sources.argoverse2.convert:SOURCE", extra="argoverse"),
    "kitti": Known("semgrid_eval.sources.kitti.convert:SOURCE"),
    "ros2": Known("semgrid_eval.sources.ros2.convert:SOURCE", extra="ros"),
    "town-v1": Known("semgrid_eval.sources.town.convert:TOWN_V1", extra="synthetic"),
}


def load_source(name: str) -> Source[Any]:
    """Import a source, one of `SOURCES`.

    Raises:
        MissingExtraError: a package of its extra is not installed.
    """
    place, extra = SOURCES[name]
    module, _, attribute = place.partition(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if not extra:
            raise
        raise MissingExtraError(extra, error.name or "a package") from error
    assert isinstance(found, Source)
    return found
