"""The sources that the command line offers, one line each."""

import importlib
from typing import Any, NamedTuple

from semgrid_eval.errors import MissingExtraError
from semgrid_eval.sources.source import Source


class Known(NamedTuple):
    """Where a `Source` is found, as `module:name`, and the extra of the package that it needs."""

    place: str
    extra: str = ""


SOURCES = {
    "cityscapes": Known("semgrid_eval.sources.cityscapes.convert:SOURCE"),
    "synthetic": Known("semgrid_eval.sources.town.convert:SOURCE", extra="synthetic"),
    "town-v1": Known("semgrid_eval.sources.town.benchmark:TOWN_V1", extra="synthetic"),
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
