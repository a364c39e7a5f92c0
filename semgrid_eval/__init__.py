"""Evaluate short-term prediction on semantic grids, offline and from recorded MCAP logs.

`import semgrid_eval as sg` offers what `__all__` names; each is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semgrid_eval.api import build_grids as build_grids
    from semgrid_eval.api import check_log as check_log
    from semgrid_eval.api import convert as convert
    from semgrid_eval.api import find_logs as find_logs
    from semgrid_eval.api import fit as fit
    from semgrid_eval.api import load_run as load_run
    from semgrid_eval.api import make_model as make_model
    from semgrid_eval.api import make_windows as make_windows
    from semgrid_eval.api import open_log as open_log
    from semgrid_eval.api import plot_grid as plot_grid
    from semgrid_eval.api import run as run
    from semgrid_eval.api import score as score
    from semgrid_eval.api import write_log as write_log
    from semgrid_eval.api import write_report as write_report
    from semgrid_eval.classes import CLASS_NAMES as CLASS_NAMES
    from semgrid_eval.classes import DEFAULT_CLASSES as DEFAULT_CLASSES
    from semgrid_eval.classes import ClassSet as ClassSet
    from semgrid_eval.classes import load_classes as load_classes
    from semgrid_eval.config import Config as Config
    from semgrid_eval.errors import SemgridError as SemgridError
    from semgrid_eval.grids.recording import GridRecording as GridRecording
    from semgrid_eval.grids.spec import GridConfig as GridConfig
    from semgrid_eval.grids.spec import GridSpec as GridSpec
    from semgrid_eval.labels import LABEL_ID as LABEL_ID
    from semgrid_eval.log.predictions import Prediction as Prediction
    from semgrid_eval.models.model import Baseline as Baseline
    from semgrid_eval.models.model import Given as Given
    from semgrid_eval.models.model import Model as Model
    from semgrid_eval.models.model import one_hot as one_hot
    from semgrid_eval.models.network import Network as Network
    from semgrid_eval.models.network import NetworkSettings as NetworkSettings
    from semgrid_eval.models.network import input_planes as input_planes
    from semgrid_eval.playback.export import export_predictions as export_predictions
    from semgrid_eval.playback.export import write_predictions as write_predictions
    from semgrid_eval.recording.disparity import coded_disparity as coded_disparity
    from semgrid_eval.recording.lidar import LidarSweep as LidarSweep
    from semgrid_eval.recording.lidar import Mount as Mount
    from semgrid_eval.recording.png import encode_gray as encode_gray
    from semgrid_eval.recording.types import Actor as Actor
    from semgrid_eval.recording.types import CameraCalibration as CameraCalibration
    from semgrid_eval.recording.types import CameraFrame as CameraFrame
    from semgrid_eval.recording.types import Moment as Moment
    from semgrid_eval.recording.types import MotionSample as MotionSample
    from semgrid_eval.recording.types import Pose as Pose
    from semgrid_eval.recording.types import Recording as Recording
    from semgrid_eval.scores.evaluate import Evaluation as Evaluation
    from semgrid_eval.scores.evaluate import evaluate as evaluate
    from semgrid_eval.scores.tidy import tidy as tidy
    from semgrid_eval.windows.data import WindowBatch as WindowBatch
    from semgrid_eval.windows.data import WindowSet as WindowSet
    from semgrid_eval.windows.plan import WindowConfig as WindowConfig

_NAMES = {
    "api": "build_grids check_log convert find_logs fit load_run make_model make_windows open_log plot_grid "
    "run score write_log write_report",
    "classes": "CLASS_NAMES ClassSet DEFAULT_CLASSES load_classes",
    "config": "Config",
    "errors": "SemgridError",
    "grids.recording": "GridRecording",
    "grids.spec": "GridConfig GridSpec",
    "labels": "LABEL_ID",
    "log.predictions": "Prediction",
    "models.model": "Baseline Given Model one_hot",
    "models.network": "Network NetworkSettings input_planes",
    "playback.export": "export_predictions write_predictions",
    "recording.disparity": "coded_disparity",
    "recording.lidar": "LidarSweep Mount",
    "recording.png": "encode_gray",
    "recording.types": "Actor CameraCalibration CameraFrame Moment MotionSample Pose Recording",
    "scores.evaluate": "Evaluation evaluate",
    "scores.tidy": "tidy",
    "windows.data": "WindowBatch WindowSet",
    "windows.plan": "WindowConfig",
}
_PLACES = {name: f"{__name__}.{module}" for module, names in _NAMES.items() for name in names.split()}
__all__ = ["__version__", *_PLACES]

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever is asked for
    """Import what is asked for: torch and matplotlib only where they are needed."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(_PLACES[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
