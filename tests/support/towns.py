"""A small simulated town, built once for all tests of a process."""

import functools
import tempfile
from pathlib import Path

from semgrid_eval.progress import silent
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan

SMALL = {"recordings": 4, "seed": 3, "towns": 2, "val_share": 0.25, "town_size_m": 250.0, "duration_s": 15.0}


@functools.cache
def town_cache() -> Path:
    """Return the folder where the small towns of this process are kept; it vanishes with the process."""
    folder = tempfile.TemporaryDirectory(prefix="semgrid-towns-")
    _KEPT.append(folder)
    return Path(folder.name)


def small_plans(**changes) -> list[RecordingPlan]:
    """Plan recordings of small pictures in two small towns."""
    values = {**SMALL, "width": 128, "height": 64, **changes}
    return plan_recordings(SyntheticConfig(**values), town_cache(), silent)


_KEPT: list[tempfile.TemporaryDirectory] = []
