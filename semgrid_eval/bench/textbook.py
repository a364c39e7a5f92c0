"""Training of the encoder-decoder as a textbook has it, to measure ours against: the same network, loss and optimizer.

Windows are prepared one by one, in float32, default memory layout and default allocator.
"""

import time

import torch
from torch import Tensor
from torch.nn import functional as F

from semgrid_eval.bench.material import GIVEN
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.models.device import seeded
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.network import masked_loss
from semgrid_eval.windows.data import WindowSet


def train_by_the_book(
    config: EncoderDecoderSettings, windows: WindowSet, *, batch: int, updates: int, epochs: int, device: torch.device
) -> list[float]:
    """Train and return the seconds of each epoch of `updates` batches; the network is thrown away."""
    with seeded(0, torch.device("cpu")):
        network = EncoderDecoder(config, GIVEN)
    network.to(device=device, memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    optimizer = torch.optim.RMSprop(network.parameters(), lr=1e-3, alpha=0.9, eps=1e-7)
    generator = torch.Generator().manual_seed(0)
    seconds = []
    for _ in range(epochs):
        start_s = time.perf_counter()
        for _ in range(updates):
            chosen = torch.randint(len(windows), (batch,), generator=generator).tolist()
            samples = [prepare_window(windows, index) for index in chosen]
            planes, target, mask = (torch.stack(column).to(device) for column in zip(*samples, strict=True))
            loss = masked_loss(network.from_planes(planes), target, mask)
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
        loss.item()  # waits for the device
        seconds.append(time.perf_counter() - start_s)
    return seconds


def prepare_window(windows: WindowSet, index: int) -> tuple[Tensor, Tensor, Tensor]:
    """Prepare one window of one sensor: one-hot inputs (T * C, H, W), target (H, W) uint8 and mask M (H, W) bool."""
    target = windows.data.grids[0, windows.target_frames[index]]
    aligned = [
        shift(windows.data.grids[0, frame], *windows.shift_cells[index, t].tolist())
        for t, frame in enumerate(windows.inputs[index].tolist())
    ]
    planes = torch.cat([F.one_hot(grid.long(), CLASS_COUNT).permute(2, 0, 1).float() for grid in aligned])
    return planes.contiguous(), target, (torch.stack(aligned) != 0).any(dim=0) & (target == 0)


def shift(grid: Tensor, rows: int, columns: int) -> Tensor:
    """Move a grid (H, W) by cells with unknown where content enters."""
    moved = torch.zeros_like(grid)
    height, width = grid.shape
    to_rows, to_columns = slice(max(rows, 0), height + min(rows, 0)), slice(max(columns, 0), width + min(columns, 0))
    from_rows = slice(max(-rows, 0), height + min(-rows, 0))
    from_columns = slice(max(-columns, 0), width + min(-columns, 0))
    moved[to_rows, to_columns] = grid[from_rows, from_columns]
    return moved
