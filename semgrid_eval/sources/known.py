"""What every source offers, and the sources that the command line offers, one line each."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from semgrid_eval.errors import MissingExtraError

if TYPE_CHECKING:  # they are heavy, and the help of the commands should not wait for them
    from semgrid_eval.config import Config
    from semgrid_eval.log.convert import ConversionSummary, Work

C = TypeVar("C", bound="Config")


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
    """Where a `Source` is found, as `module:name`, its line of `convert --help`, and the extra its module needs."""

    place: str
    summary: str
    extra: str = ""


SOURCES = {
    "cityscapes": Known("semgrid_eval.sources.cityscapes.source:SOURCE", "Sequence trees in Cityscapes' layout."),
    "synthetic": Known("semgrid_eval.sources.town.source:SYNTHETIC", "Drives through a simulated town."),
    "argoverse2": Known("semgrid_eval.sources.argoverse2.source:SOURCE", "Argoverse 2's Sensor data: tracks and maps."),
    "kitti": Known("semgrid_eval.sources.kitti.source:SOURCE", "KITTI's and SemanticKITTI's sequences."),
    "ros2": Known("semgrid_eval.sources.ros2.source:SOURCE", "ROS 2 bags, by a map of their topics."),
    "town-v1": Known("semgrid_eval.sources.town.source:TOWN_V1", "A frozen data set of the simulated town."),
    "town-rig-v1": Known("semgrid_eval.sources.town.source:TOWN_RIG_V1", "Likewise, with four cameras and a LiDAR."),
}


def load_source(name: str) -> Source[Any]:
    """Import a source, one of `SOURCES`.

    Raises:
        MissingExtraError: a package of its extra is not installed.
    """
    known = SOURCES[name]
    found = _imported(known.place, known.extra)
    assert isinstance(found, Source)
    return found


def later(place: str, extra: str = "") -> Callable[..., Any]:
    """Return what a source does, `module:name`, to be imported when it is called: no help waits for it.

    Where a package of `extra` is not installed, the call raises a MissingExtraError.
    """

    def call(*given: object) -> Any:  # noqa: ANN401 - whatever it returns
        return _imported(place, extra)(*given)

    return call


def _imported(place: str, extra: str) -> Any:  # noqa: ANN401 - what stands there
    module, _, attribute = place.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if not extra:
            raise
        raise MissingExtraError(extra, error.name or "a package") from error
