"""What a training needs at least, worked out without allocating it, so that what cannot fit is refused at once."""

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.models.device import seeded
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Network, TrainingConfig
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.workplace import Limits

_GIB = 1 << 30
_WEIGHT_BYTES, _ACTIVATION_BYTES, _INDEX_BYTES = 4, 2, 8  # activations may be bfloat16
_COPIES = 3  # weights, gradients and what the optimiser remembers of each
_LIMIT_FILE = Path("/sys/fs/cgroup/memory.max")


def require_room(network: type[Network], settings: Config, given: Given, device: torch.device) -> None:
    """Make sure that a training can fit into the memory of its device, by what it needs at least.

    Networks that cannot be built without memory (on PyTorch's meta device) are not looked at.

    Raises:
        InputError: it cannot.
    """
    config: TrainingConfig = settings.training  # type: ignore[attr-defined] # of every network's settings
    with seeded(0, torch.device("cpu")):  # whatever it draws is drawn again
        needed = least_bytes(network, settings, given, config)
    there = memory_bytes(device)
    if needed > there:
        size = f"{needed / _GIB:.0f} GiB at least, and {device} has {there / _GIB:.0f} GiB"
        raise InputError(f"its training needs {size}: batch {config.batch} or its layers are too large")


def least_bytes(network: type[Network], settings: Config, given: Given, config: TrainingConfig) -> int:
    """Work out the bytes of weights with all that goes with them, of an update's activations and of drawn windows."""
    drawn = config.updates_until(1) * config.batch * _INDEX_BYTES
    found = [0]

    def note(module: nn.Module, _given: Any, output: Any) -> None:  # noqa: ANN401 - of whatever layer
        if isinstance(output, Tensor) and not getattr(module, "inplace", False):
            found[0] += output.numel()

    weights = 0
    # Code of one's own may do what no meta tensor can.
    with suppress(Exception), torch.device("meta"), torch.no_grad():
        skeleton = network(settings, given)
        weights = sum(each.numel() for each in skeleton.parameters())
        for module in skeleton.modules():
            if not list(module.children()):
                module.register_forward_hook(note)
        skeleton(_batch(given, config.batch))
    return drawn + weights * _WEIGHT_BYTES * _COPIES + found[0] * _ACTIVATION_BYTES


def memory_bytes(device: torch.device) -> int:
    """Return the memory of a device; on a CPU that of the machine, or what this process may use of it."""
    if device.type == "cuda":
        return int(torch.cuda.mem_get_info(device)[1])
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 1 << 62
    try:
        return min(machine, int(_LIMIT_FILE.read_text()))
    except (OSError, ValueError):  # there is no limit
        return machine


def guest_limits(time_s: float | None = Limits.time_s, memory_gib: float | None = None) -> Limits:
    """Return the limits of models of one's own; of memory seven eighths of the machine's, if nothing is given."""
    usual = memory_bytes(torch.device("cpu")) // 8 * 7
    return Limits(time_s, usual if memory_gib is None else int(memory_gib * _GIB))


def _batch(given: Given, count: int) -> WindowBatch:
    cells = (given.rows, given.columns)
    return WindowBatch(
        past=torch.empty((count, len(given.sensors), given.inputs, *cells), dtype=torch.uint8),
        sensors=given.sensors,
        shift_cells=torch.empty((count, given.inputs, 2), dtype=torch.int64),
        lead_s=torch.empty((count, given.inputs)),
        target=torch.empty((count, *cells), dtype=torch.uint8),
        mask=torch.empty((count, *cells), dtype=torch.bool),
    )
