"""Evaluate short-term prediction on semantic grids, offline and from recorded MCAP logs.

`import semgrid_eval as sg` offers what `__all__` names; each is imported when it is first asked for.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semgrid_eval.api import build_grids, convert, fit, make_model, make_windows, open_log, plot_grid, run, score
    from semgrid_eval.classes import CLASS_NAMES, CLASSES
    from semgrid_eval.config import Config
    from semgrid_eval.errors import SemgridError
    from semgrid_eval.grids.recording import GridRecording
    from semgrid_eval.grids.spec import GridConfig, GridSpec
    from semgrid_eval.log.store import find_logs
    from semgrid_eval.models.model import Baseline, Given, Model, one_hot
    from semgrid_eval.models.network import Network, NetworkSettings, input_planes
    from semgrid_eval.report.page.write import write_report
    from semgrid_eval.scores.evaluate import Evaluation, evaluate
    from semgrid_eval.scores.tidy import load_figures as load_run
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

_API = ("build_grids", "convert", "fit", "make_model", "make_windows", "open_log", "plot_grid", "run", "score")
_PLACES = {
    **dict.fromkeys(_API, "api"),
    **dict.fromkeys(("CLASSES", "CLASS_NAMES"), "classes"),
    "Config": "config",
    "SemgridError": "errors",
    "GridRecording": "grids.recording",
    **dict.fromkeys(("GridConfig", "GridSpec"), "grids.spec"),
    "find_logs": "log.store",
    **dict.fromkeys(("Baseline", "Given", "Model", "one_hot"), "models.model"),
    **dict.fromkeys(("Network", "NetworkSettings", "input_planes"), "models.network"),
    "write_report": "report.page.write",
    **dict.fromkeys(("Evaluation", "evaluate"), "scores.evaluate"),
    **dict.fromkeys(("load_figures", "tidy"), "scores.tidy"),
    **dict.fromkeys(("WindowBatch", "WindowSet"), "windows.data"),
    "WindowConfig": "windows.plan",
}
_CALLED = {"load_run": "load_figures"}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever is asked for
    """Import what is asked for: torch and matplotlib only where they are needed."""
    called = _CALLED.get(name, name)
    if name not in __all__ or called not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_PLACES[called]}"), called)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
