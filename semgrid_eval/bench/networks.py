"""Measures training, against a textbook's and against the machine's matrix rate, prediction and scoring."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import torch
from torch.utils.flop_counter import FlopCounterMode

from semgrid_eval.bench.material import GIVEN, random_windows
from semgrid_eval.bench.measurement import Measurement, Settings, wall_s
from semgrid_eval.bench.textbook import train_by_the_book
from semgrid_eval.config import Config
from semgrid_eval.models.device import Precision, choose_precision, settle_process
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.network import TrainingConfig, seeded_network
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.training import train
from semgrid_eval.scores.evaluate import evaluate


def measure_training(settings: Settings, device: torch.device) -> Iterator[Measurement]:
    """Train networks of different width: windows a second, ours and a textbook's.

    All of the textbook's come first, because ours are measured in a process that keeps its memory.
    """
    textbook = {f: _textbook_rate(EncoderDecoderSettings(features=f), settings, device) for f in settings.features}
    settle_process()
    dtype = choose_precision("auto", device)
    name = str(dtype).removeprefix("torch.")
    matrix_rate = _matrix_rate(settings, device, dtype)
    yield Measurement(f"product of {name} matrices", matrix_rate / 1e9, "Gflop/s")
    for features, slow in textbook.items():
        config = EncoderDecoderSettings(features=features)
        rate = _training_rate(config, settings, device)
        share = rate * _flops_of_an_update(config, settings.batch) / settings.batch / matrix_rate
        yield Measurement(f"f {features}, batch {settings.batch}, {name}", rate, "windows/s")
        if dtype is not torch.float32:
            plain = _training_rate(config, settings, device, precision="float32")
            yield Measurement(f"f {features}, batch {settings.batch}, float32", plain, "windows/s")
        yield Measurement(f"f {features}, batch {settings.batch}, textbook", slow, "windows/s")
        yield Measurement(f"f {features}, against the textbook", rate / slow, "times")
        yield Measurement(f"f {features}, against the product of matrices", 100.0 * share, "%")


def measure_prediction(settings: Settings, device: torch.device) -> Iterator[Measurement]:
    """Predict windows with networks, and score them."""
    windows = random_windows(settings.windows).to(device)
    for features in settings.features:
        config = EncoderDecoderSettings(features=features)
        network = seeded_network(EncoderDecoder, config, GIVEN, seed=0).to(device).eval()
        evaluate(network, windows)
        took_s = median(evaluate(network, windows).seconds for _ in range(settings.repeats))
        yield Measurement(f"predicted, f {features}", len(windows) / took_s, "windows/s")
    newest = RepeatNewest(Config(), GIVEN)
    took_s = wall_s(lambda: evaluate(newest, windows), settings.repeats)
    yield Measurement("predicted by BL-DC and scored", len(windows) / took_s, "windows/s")


def _textbook_rate(config: EncoderDecoderSettings, settings: Settings, device: torch.device) -> float:
    # The first epoch warms up.
    seconds = train_by_the_book(
        config,
        random_windows(),
        batch=settings.batch,
        updates=settings.updates,
        epochs=settings.repeats + 1,
        device=device,
    )
    return settings.updates * settings.batch / median(seconds[1:])


def _training_rate(
    config: EncoderDecoderSettings, settings: Settings, device: torch.device, *, precision: Precision = "auto"
) -> float:
    training = TrainingConfig(
        epochs=settings.repeats + 1, updates_per_epoch=settings.updates, batch=settings.batch, precision=precision
    )
    network = seeded_network(EncoderDecoder, config.model_copy(update={"training": training}), GIVEN, seed=0)
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


def _flops_of_an_update(config: EncoderDecoderSettings, batch: int) -> float:
    """Count the floating-point operations of the network, forward and backward, over one batch."""
    windows = random_windows()
    network = seeded_network(EncoderDecoder, config, GIVEN, seed=0)
    part = windows.batch(slice(0, 1))
    with FlopCounterMode(display=False) as counter:
        network.loss(network(part), part).backward()  # type: ignore[no-untyped-call]
    return float(counter.get_total_flops()) * batch
