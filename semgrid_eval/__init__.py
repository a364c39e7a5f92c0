"""Evaluate short-term prediction on semantic grids, offline and from recorded MCAP logs.

`import semgrid_eval as sg` offers what `__all__` names; each is imported when it is first asked for.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semgrid_eval.api import (
        build_grids,
        convert,
        find_logs,
        fit,
        load_run,
        make_model,
        make_windows,
        open_log,
        plot_grid,
        run,
        score,
        write_report,
    )
    from semgrid_eval.classes import CLASS_NAMES, CLASSES
    from semgrid_eval.config import Config
    from semgrid_eval.errors import SemgridError
    from semgrid_eval.grids.recording import GridRecording
    from semgrid_eval.grids.spec import GridConfig, GridSpec
    from semgrid_eval.models.model import Baseline, Given, Model, one_hot
    from semgrid_eval.models.network import Network, NetworkSettings, input_planes
    from semgrid_eval.scores.evaluate import Evaluation, evaluate
    from semgrid_eval.scores.tidy import tidy
    from semgrid_eval.windows.data import WindowBatch, WindowSet
    from semgrid_eval.windows.plan import WindowConfig

try:
    __version__ = version("semgrid-eval")
except PackageNotFoundError:  # running from a source tree that was never installed
    __version__ = "0.0.0"

__all__ = [
    "CLASSES",
    "CLASS_NAMES",
    "Baseline",
    "Config",
    "Evaluation",
    "Given",
    "GridConfig",
    "GridRecording",
    "GridSpec",
    "Model",
    "Network",
    "NetworkSettings",
    "SemgridError",
    "WindowBatch",
    "WindowConfig",
    "WindowSet",
    "__version__",
    "build_grids",
    "convert",
    "evaluate",
    "find_logs",
    "fit",
    "input_planes",
    "load_run",
    "make_model",
    "make_windows",
    "one_hot",
    "open_log",
    "plot_grid",
    "run",
    "score",
    "tidy",
    "write_report",
]

_API = (
    *("build_grids", "convert", "find_logs", "fit", "load_run", "make_model", "make_windows"),
    *("open_log", "plot_grid", "run", "score", "write_report"),
)
_PLACES = {
    **dict.fromkeys(_API, "api"),
    **dict.fromkeys(("CLASSES", "CLASS_NAMES"), "classes"),
    "Config": "config",
    "SemgridError": "errors",
    "GridRecording": "grids.recording",
    **dict.fromkeys(("GridConfig", "GridSpec"), "grids.spec"),
    **dict.fromkeys(("Baseline", "Given", "Model", "one_hot"), "models.model"),
    **dict.fromkeys(("Network", "NetworkSettings", "input_planes"), "models.network"),
    **dict.fromkeys(("Evaluation", "evaluate"), "scores.evaluate"),
    "tidy": "scores.tidy",
    **dict.fromkeys(("WindowBatch", "WindowSet"), "windows.data"),
    "WindowConfig": "windows.plan",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever is asked for
    """Import what is asked for: torch and matplotlib only where they are needed."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
