"""What tests on a CUDA device share; they are skipped where there is none."""

import pytest
import torch

from semgrid_eval.models.device import settle_process
from semgrid_eval.models.network import Network
from semgrid_eval.models.registry import MODELS, find_model
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

CPU, CUDA = torch.device("cpu"), torch.device("cuda")
NEEDS_CUDA = [
    pytest.mark.cuda,
    pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no CUDA device on this machine"),
]
NETWORKS = sorted(name for name in MODELS if issubclass(find_model(name), Network))
"""Built-in models that gradients train."""


@pytest.fixture
def settled():
    """Set what a run sets for its process, and set it back."""
    cudnn = torch.backends.cudnn
    before = cudnn.deterministic, cudnn.allow_tf32
    settle_process()
    yield
    cudnn.deterministic, cudnn.allow_tf32 = before


def windows_of(recordings, *, step_frames=2, sensors=("full",), translate=True) -> WindowSet:
    """Select all training windows of recordings."""
    data = stack_recordings(recordings, cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(step_frames=step_frames))
    return select_windows(data, plan.windows, sensors=sensors, translate=translate)
