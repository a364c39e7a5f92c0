"""What every source offers: options, and one call that converts what they choose to logs."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from semgrid_eval.config import Config
from semgrid_eval.log.convert import ConversionSummary, Work

C = TypeVar("C", bound=Config)


@dataclass(frozen=True)
class Source(Generic[C]):
    """What makes recordings, as the command line offers it.

    Each field of `options` is an option, described by its `description`; a path without default is an argument.
    """

    options: type[C]
    convert: Callable[[C, Path, Work], ConversionSummary]  # writes the logs OUT/<split>/<name>.mcap of what is chosen
    help: str  # what the command does
    example: str  # a use of the command
    cache: str = ""  # what the source keeps in the folder `Work.cache`, and where that is by default; empty if nothing
