"""Measure training of the encoder-decoder: windows a second, ours against the textbook recipe, in one run.

    python tools/bench_training.py --features 16 32 64 --batch 8 --threads 2

Textbook: windows prepared one by one, float32, default memory layout, default allocator. Ours: `train` as it is.
Every measurement has a process of its own; the two recipes take turns and the best of each counts, which keeps other
work on the machine out of the ratio as far as possible.
"""

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.grids.build import GridRecording
from semgrid_eval.models.network import NetworkConfig, seeded_network
from semgrid_eval.models.training import TrainingConfig, masked_loss, train
from semgrid_eval.sequences.dataset import WindowSet, select_windows, stack_recordings
from semgrid_eval.sequences.windows import WindowConfig, training_windows

SIZE, CELL_M, FRAMES = 128, 100 / 128, 30
UPDATES, EPOCHS = 3, 3
CPU = torch.device("cpu")


def main() -> None:
    """Print one line of JSON for each number of features."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--features", type=int, nargs="+", default=[16, 32, 64])
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--rounds", type=int, default=2, help="turns of each recipe")
    arguments = parser.parse_args()
    for features in arguments.features:
        rates: dict[str, float] = {"textbook": 0.0, "float32": 0.0, "auto": 0.0}
        for _ in range(arguments.rounds):
            for recipe, best in rates.items():
                rates[recipe] = max(best, in_own_process(recipe, features, arguments.batch, arguments.threads))
        line = {"features": features, "batch": arguments.batch, "threads": arguments.threads}
        line |= {f"{recipe}_windows_per_s": round(rate, 2) for recipe, rate in rates.items()}
        line["ratio"] = round(rates["auto"] / rates["textbook"], 2)
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()


def in_own_process(recipe: str, features: int, batch: int, threads: int) -> float:
    """Measure windows a second in a fresh process."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, recipe, features, batch, threads).result()


def measure(recipe: str, features: int, batch: int, threads: int) -> float:
    """Give the windows a second of the fastest epoch; the first one warms up."""
    torch.set_num_threads(threads)
    config, windows = NetworkConfig(features=features), sample_windows(4)
    seconds = textbook(config, windows, batch) if recipe == "textbook" else ours(config, windows, batch, recipe)
    return UPDATES * batch / min(seconds[1:])


def ours(config: NetworkConfig, windows: WindowSet, batch: int, precision: str) -> list[float]:
    """Train as the package does and give the seconds of each epoch."""
    training = TrainingConfig.model_validate(
        {"epochs": EPOCHS, "updates_per_epoch": UPDATES, "batch": batch, "precision": precision}
    )
    with tempfile.TemporaryDirectory() as folder:
        trained = train(windows, config, training, seed=0, device=CPU, folder=Path(folder))
    return [row.seconds for row in trained.history]


def textbook(config: NetworkConfig, windows: WindowSet, batch: int) -> list[float]:
    """Train as a textbook would and give the seconds of each epoch."""
    network = seeded_network(config, grids=windows.grids_per_window, preset="keras", seed=0)
    network.to(memory_format=torch.contiguous_format)
    optimizer = torch.optim.RMSprop(network.parameters(), lr=1e-3, alpha=0.9, eps=1e-7)
    random = np.random.default_rng(0)
    seconds = []
    for _ in range(EPOCHS):
        started_s = time.perf_counter()
        for _ in range(UPDATES):
            samples = [textbook_window(windows, int(i)) for i in random.integers(0, len(windows), batch)]
            planes, target, mask = (torch.stack(column) for column in zip(*samples, strict=True))
            loss = masked_loss(network.from_planes(planes), target, mask)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        seconds.append(time.perf_counter() - started_s)
    return seconds


def textbook_window(windows: WindowSet, index: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Prepare one window by itself: one-hot inputs (T * C, H, W), target and mask (H, W)."""
    target = windows.data.grids[0, windows.target_frames[index]]
    aligned = [
        shift(windows.data.grids[0, frame], *windows.shift_cells[index, t].tolist())
        for t, frame in enumerate(windows.inputs[index].tolist())
    ]
    planes = torch.cat([F.one_hot(grid.long(), CLASS_COUNT).permute(2, 0, 1).float() for grid in aligned])
    return planes.contiguous(), target, (torch.stack(aligned) != 0).any(dim=0) & (target == 0)


def shift(grid: torch.Tensor, rows: int, columns: int) -> torch.Tensor:
    """Move a grid (H, W) by cells with unknown where content enters."""
    moved = torch.zeros_like(grid)
    height, width = grid.shape
    to_rows, to_columns = slice(max(rows, 0), height + min(rows, 0)), slice(max(columns, 0), width + min(columns, 0))
    from_rows = slice(max(-rows, 0), height + min(-rows, 0))
    from_columns = slice(max(-columns, 0), width + min(-columns, 0))
    moved[to_rows, to_columns] = grid[from_rows, from_columns]
    return moved


def sample_windows(count: int) -> WindowSet:
    """Make windows over random coarse grids; the time of a training does not depend on what they show."""
    random = np.random.default_rng(0)
    recordings = []
    for number in range(count):
        coarse = random.integers(0, CLASS_COUNT, (1, FRAMES, SIZE // 8, SIZE // 8), dtype=np.uint8)
        recordings.append(
            GridRecording(
                name=str(number),
                log="",
                digest=str(number),
                split="train",
                dataset="synthetic",
                sensors=("full",),
                stamps_ns=np.arange(FRAMES, dtype=np.int64) * 58_823_529,
                grids=coarse.repeat(8, axis=2).repeat(8, axis=3),
                position_m=np.cumsum(random.normal(0.3, 0.1, (FRAMES, 2)), axis=0),
                yaw_rad=np.zeros(FRAMES),
            )
        )
    data = stack_recordings(recordings, cell_m=CELL_M)
    return select_windows(data, training_windows(data.frame_counts, WindowConfig()).windows, sensors=["full"])


if __name__ == "__main__":
    main()
