"""Leads in milliseconds: the best one that a report found for a latency, and the frames that a lead is."""

from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.faults import not_one_of
from semgrid_eval.files import read_json

LONGEST_LEAD_MS = 60_000
_FROM = "from "
_HEADLINE = "mean_known"


class BestLeads(Config):
    """The leads that give the highest streaming IoU, in ms, by the name of a category; a report writes them."""

    lead_ms: dict[str, Annotated[float, Field(gt=0, le=LONGEST_LEAD_MS)]]


def lead_from(value: object) -> object:
    """Read a lead in ms for `from FILE` or `from FILE:CATEGORY`; return anything else as it is.

    A ValueError says that the file cannot be read or lacks the category.
    """
    if not (isinstance(value, str) and value.startswith(_FROM)):
        return value
    file, category = value.removeprefix(_FROM), ""
    if not Path(file).is_file():
        file, _, category = file.rpartition(":") if ":" in file else (file, "", "")
    if not file:
        raise ValueError(f"{value!r} names no file")
    try:
        found = parse_config(BestLeads, read_json(Path(file)), path=file).lead_ms
    except (InputError, OSError) as error:
        raise ValueError(str(error)) from None
    wanted = category or _HEADLINE
    if wanted not in found:
        raise ValueError(f"{file}: lead_ms: {not_one_of(wanted, found)}")
    return found[wanted]


def frames_of(lead_ms: float, stamps_ns: NDArray[np.int64]) -> int:
    """Return the frames, at least one, that come nearest to a lead at the rate of these captures (F,)."""
    period = period_ns(stamps_ns)
    return max(1, round(lead_ms * 1e6 / period)) if period > 0 else 1


def period_ns(stamps_ns: NDArray[np.int64]) -> int:
    """Return the median time between captures (F,), 0 where there is one."""
    return round(float(np.median(np.diff(stamps_ns)))) if len(stamps_ns) > 1 else 0
