"""Measures training, against a textbook's and against the machine's matrix rate, prediction and scoring."""

import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from statistics import median

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

from semgrid_eval.bench.cells import measure_scoring
from semgrid_eval.bench.measurement import Measurement, Settings, seconds_passed, times_as_fast, wall_s
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import Config
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.models.device import Precision, choose_precision, settle_process
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Network, NetworkSettings, masked_loss, seeded_network
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.residual import Residual, ResidualSettings
from semgrid_eval.models.training import train
from semgrid_eval.scores.evaluate import evaluate
from semgrid_eval.windows.data import WindowBatch, WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

_CELLS, _CELL_M, _FRAMES, _FRAME_NS = 128, 100 / 128, 30, 58_823_529
_COARSE = 8  # cells of a random patch
SHARE_AT_LEAST = {"f 16": 51.0, "f 32": 71.0, "f 64": 89.0, "RN": 60.0}
"""Percent of the product of matrices; for the encoder-decoders, what a machine with bf16 has reached."""
TEXTBOOK_AT_LEAST = 2.8  # likewise
GIVEN = Given(("full",), WindowConfig().inputs, _CELLS, _CELLS, _CELL_M, translate=True)
"""What a row of random windows gives its model."""


@dataclass(frozen=True)
class Subject:
    """A network that is measured."""

    name: str
    settings: NetworkSettings
    kind: type[Network] = EncoderDecoder

    def network(self, **training: object) -> Network:
        """Make it untrained, with some settings of its training changed."""
        changed = {"training": self.settings.training.model_copy(update=training)}
        return seeded_network(self.kind, self.settings.model_copy(update=changed), GIVEN, seed=0)


RESIDUAL = Subject("RN", ResidualSettings(), Residual)


def encoder_decoder(features: int) -> Subject:
    """Return the encoder-decoder of a width."""
    return Subject(f"f {features}", EncoderDecoderSettings(features=features))


def measure_training(settings: Settings, device: torch.device) -> Iterator[Measurement]:
    """Train networks: windows a second, against a textbook's and against the product of matrices.

    All of the textbook's come first, because ours are measured in a process that keeps its memory.
    """
    subjects = [encoder_decoder(features) for features in settings.features]
    textbook = {each.name: _textbook_rate(each.settings, settings, device) for each in subjects}
    settle_process()
    dtype = choose_precision("auto", device)
    name = str(dtype).removeprefix("torch.")
    matrix_rate = _matrix_rate(settings, device, dtype)
    yield Measurement(f"product of {name} matrices", matrix_rate / 1e9, "Gflop/s")
    for subject in (*subjects, RESIDUAL):
        rate = _training_rate(subject, settings, device)
        share = rate * flops_of_an_update(subject, settings.batch) / settings.batch / matrix_rate
        yield Measurement(f"{subject.name}, batch {settings.batch}, {name}", rate, "windows/s")
        if dtype is not torch.float32:
            plain = _training_rate(subject, settings, device, precision="float32")
            yield Measurement(f"{subject.name}, batch {settings.batch}, float32", plain, "windows/s")
        if slow := textbook.get(subject.name):
            yield Measurement(f"{subject.name}, batch {settings.batch}, textbook", slow, "windows/s")
            gain = rate / slow
            yield Measurement(f"{subject.name}, against the textbook", gain, "times", at_least=TEXTBOOK_AT_LEAST)
        at_least = SHARE_AT_LEAST.get(subject.name)
        yield Measurement(f"{subject.name}, against the product of matrices", 100.0 * share, "%", at_least=at_least)


def measure_prediction(settings: Settings, device: torch.device) -> Iterator[Measurement]:
    """Predict windows with networks, many and one at a time, and score them."""
    windows = random_windows(settings.windows).to(device)
    subjects = [encoder_decoder(features) for features in settings.features]
    for subject in (*subjects, RESIDUAL):
        network = subject.network().to(device).eval()
        evaluate(network, windows)
        took_s = median(evaluate(network, windows).seconds for _ in range(settings.repeats))
        yield Measurement(f"predicted, {subject.name}", len(windows) / took_s, "windows/s")
    yield from _measure_answers(subjects[-1], windows.batch(slice(1)), settings)
    newest = RepeatNewest(Config(), GIVEN)
    took_s = wall_s(lambda: evaluate(newest, windows), settings.repeats)
    yield Measurement("predicted by BL-DC and scored", len(windows) / took_s, "windows/s")
    yield from measure_scoring(settings)


def _measure_answers(largest: Subject, window: WindowBatch, settings: Settings) -> Iterator[Measurement]:
    """Answer for one window with the largest encoder-decoder, against eager float32, and with RN, against it."""
    device, repeats = window.past.device, 3 * settings.repeats
    network, residual = (subject.network().to(device).eval() for subject in (largest, RESIDUAL))
    exact = largest.network(precision="float32").to(device).eval()
    exact.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload] # torch's stubs lack this form
    answer, plain, by_residual = (partial(each.predict, window) for each in (network, exact, residual))
    equal = (answer().argmax(dim=1) == plain().argmax(dim=1)).double().mean()
    by_residual()
    name = f"one window, {largest.name}"
    yield Measurement(name, 1e3 * wall_s(lambda: answer().cpu(), repeats), "ms")
    gain = times_as_fast(lambda: answer().cpu(), lambda: plain().cpu(), repeats, clock=seconds_passed)
    yield Measurement(f"{name}, against eager float32", gain, "times", at_least=2.0)
    yield Measurement(f"{name}, cells of equal class", 100.0 * float(equal), "%", at_least=99.5)
    gain = times_as_fast(lambda: by_residual().cpu(), lambda: answer().cpu(), repeats, clock=seconds_passed)
    yield Measurement(f"one window, RN, against {largest.name}", gain, "times", at_least=2.0)


def _textbook_rate(config: NetworkSettings, settings: Settings, device: torch.device) -> float:
    network = seeded_network(EncoderDecoder, config, GIVEN, seed=0)
    windows, generator = random_windows(), torch.Generator().manual_seed(0)
    size = (settings.repeats + 1, settings.updates, settings.batch)  # the first epoch warms up
    order = torch.randint(len(windows), size, generator=generator)
    seconds = train_by_the_book(network, windows, order, device=device)
    return settings.updates * settings.batch / median(seconds[1:])


def _training_rate(
    subject: Subject, settings: Settings, device: torch.device, *, precision: Precision = "auto"
) -> float:
    network = subject.network(
        epochs=settings.repeats + 1, updates_per_epoch=settings.updates, batch=settings.batch, precision=precision
    )
    with tempfile.TemporaryDirectory() as folder:
        trained = train(network, random_windows(), seed=0, device=device, folder=Path(folder))
    return settings.updates * settings.batch / median(row.seconds for row in trained.history[1:])


def _matrix_rate(settings: Settings, device: torch.device, dtype: torch.dtype) -> float:
    """Return the floating-point operations a second of a large product of matrices: the best a network could do."""
    left = torch.ones(settings.matrix_rows, settings.matrix_rows, device=device, dtype=dtype)
    seconds = []
    for _ in range(settings.repeats + 1):
        start_s = time.perf_counter()
        product = left @ left
        product[0, 0].item()  # waits for the device
        seconds.append(time.perf_counter() - start_s)
    return 2.0 * settings.matrix_rows**3 / median(seconds[1:])


def flops_of_an_update(subject: Subject, batch: int) -> float:
    """Count the floating-point operations of the network, forward and backward, over one batch."""
    windows = random_windows()
    network = subject.network()
    part = windows.batch(slice(0, 1))
    with FlopCounterMode(display=False) as counter:
        network.loss(network(part), part).backward()  # type: ignore[no-untyped-call]
    return float(counter.get_total_flops()) * batch


def train_by_the_book(
    network: EncoderDecoder, windows: WindowSet, order: Tensor, *, device: torch.device
) -> list[float]:
    """Train as a textbook has it and return the seconds of each epoch.

    Network, loss and optimiser are ours; windows are prepared one by one, in float32, default memory layout and
    default allocator. `order` has the windows of all batches (epochs, updates, batch).
    """
    network.to(device=device, memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    optimizer = network.optimizer()
    seconds = []
    for epoch in order.tolist():
        start_s = time.perf_counter()
        for chosen in epoch:
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


@cache
def random_windows(count: int = 80) -> WindowSet:
    """Make windows over random coarse grids; how long a network takes does not depend on what they show."""
    random = np.random.default_rng(0)
    config = WindowConfig()
    recordings = math.ceil(count / (_FRAMES - config.reach_frames))
    data = stack_recordings([_random_recording(str(number), random) for number in range(recordings)], cell_m=_CELL_M)
    return select_windows(data, training_windows(data.frame_counts, config).windows[:count], sensors=["full"])


def _random_recording(name: str, random: np.random.Generator) -> GridRecording:
    size = _CELLS // _COARSE
    coarse = random.integers(0, CLASS_COUNT, (1, _FRAMES, size, size), dtype=np.uint8)
    return GridRecording(
        name=name,
        log="",
        digest=name,
        split="train",
        dataset="random",
        sensors=("full",),
        target="full",
        stamps_ns=np.arange(_FRAMES, dtype=np.int64) * _FRAME_NS,
        grids=coarse.repeat(_COARSE, axis=2).repeat(_COARSE, axis=3),
        position_m=np.cumsum(random.normal(0.3, 0.1, (_FRAMES, 2)), axis=0),
        yaw_rad=np.zeros(_FRAMES),
    )
