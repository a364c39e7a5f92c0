"""Try int8: answers of networks for one window by ONNX Runtime, beside those of eager float32 by PyTorch.

Each network is exported and quantised by ONNX Runtime's static way: scales of weights by channel, scales of activations
from windows of the training split, which are never those that are scored. All ways answer the same windows in turn, so
that whatever else the machine does meets all alike. Rows that need a training are trained, or found in RUN.

Example: python tools/int8.py MATRIX --logs LOGS --out RUN --windows 120
"""

import argparse
import logging
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semgrid_eval.errors import ConfigError
from semgrid_eval.models.device import cpu_facts
from semgrid_eval.models.model import Model
from semgrid_eval.models.network import Network
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.runs.worker import Worker
from semgrid_eval.scores.metrics.iou import class_iou, confusion
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.segmentation.session import open_model
from semgrid_eval.windows.data import WindowBatch, WindowSet, select_windows
from semgrid_eval.windows.plan import training_windows

OPSET = 17
GOAL_PERCENT = 99.5
PLAIN = "eager float32"
VNNI = ("avx512_vnni", "avx_vnni", "amx_int8")

Answer = Callable[[WindowBatch], NDArray[np.uint8]]
"""Classes of the one window of a batch: (H, W) uint8."""


@dataclass(frozen=True)
class Way:
    """One way to answer, and what became of it on the same windows as all others."""

    name: str
    wall_ms: float
    cpu_ms: float
    wall_times: float  # as fast as eager float32: the median over pairs
    cpu_times: float
    equal_percent: float  # of all cells: those to which eager float32 gives the same class
    mean_iou: float


def main() -> int:
    """Print a table for each network of a matrix."""
    chosen = parser().parse_args()
    torch.set_num_threads(chosen.threads)
    matrix = load_matrix(chosen.matrix)
    options = RunOptions("cpu", chosen.grids or chosen.out / "grids", "int8.py")
    worker = make_worker(matrix, chosen.logs, chosen.out, options, silent_stage)
    sys.stdout.write(f"{chosen.threads} threads; {instructions()}; calibrated on {chosen.calibrated} windows\n")
    for row in matrix.rows:
        subject = Subject(worker, row, chosen.calibrated, chosen.windows)
        sys.stdout.write("\n".join(table(row.name, subject.ways(chosen.threads))) + "\n")
        sys.stdout.flush()
    return 0


class Subject:
    """The network of a row, fitted, with windows to calibrate on and windows to score."""

    def __init__(self, worker: Worker, row: Row, calibrated: int, scored: int) -> None:
        seed = worker.example_seed if row.facts.learns else None
        job = worker.look(row, seed)
        self.model = worker.fitted(job).model
        self.network = plain_network(self.model)
        self.scored = spread(job.scored, scored)
        data = worker.training_data.data(row.grid, row.train_split)
        planned = training_windows(data.frame_counts, row.window)
        windows = select_windows(data, planned.windows, sensors=row.sensors, translate=row.translate)
        self.calibrated = spread(windows, calibrated)
        require_apart(self.calibrated, self.scored)

    def ways(self, threads: int) -> list[Way]:
        """Answer the scored windows in all ways."""
        with tempfile.TemporaryDirectory() as folder:
            exported, quantised = Path(folder, "float32.onnx"), Path(folder, "int8.onnx")
            export(self.network, self.scored[0], exported)
            quantise(exported, quantised, self.calibrated)
            answers: dict[str, Answer] = {
                PLAIN: by_torch(self.network),
                "the package": by_torch(self.model.predict),
                "ONNX Runtime, float32": Runtime(exported, threads),
                "ONNX Runtime, int8": Runtime(quantised, threads),
            }
            return list(compared(answers, self.scored))


def plain_network(model: Model) -> Network:
    """Return a copy of the network in a model, in PyTorch's default memory layout."""
    found = model if isinstance(model, Network) else getattr(model, "network", None)
    if not isinstance(found, Network):
        raise ConfigError("is not a network", field=model.called)
    return deepcopy(found).eval().to(memory_format=torch.contiguous_format)  # type: ignore[call-overload,no-any-return]


def spread(windows: WindowSet, count: int) -> list[WindowBatch]:
    """Choose so many windows, evenly over all of a set."""
    places = torch.linspace(0, len(windows) - 1, min(count, len(windows))).round().long()
    return [windows.batch(places[i : i + 1]) for i in range(len(places))]


def require_apart(calibrated: Sequence[WindowBatch], scored: Sequence[WindowBatch]) -> None:
    """Make sure that no scored window is calibrated on."""
    seen = {batch.past.numpy().tobytes() + batch.target.numpy().tobytes() for batch in calibrated}
    if any(batch.past.numpy().tobytes() + batch.target.numpy().tobytes() in seen for batch in scored):
        raise ConfigError("a window that is scored is calibrated on", field="train_split")


class Exported(nn.Module):
    """A network as a function of what ONNX knows: grids (1, S, T, H, W) uint8 and leads (1, T) -> logits."""

    def __init__(self, network: Network, like: WindowBatch) -> None:
        super().__init__()
        self.network, self._like = network, like

    def forward(self, past: Tensor, lead_s: Tensor) -> Tensor:
        """Score the target: (1, C, H, W)."""
        like = self._like
        return torch.as_tensor(
            self.network(WindowBatch(past, like.sensors, like.shift_cells, lead_s, like.target, like.mask))
        )


def export(network: Network, window: WindowBatch, path: Path) -> None:
    """Write a network as ONNX, for one window."""
    exported = Exported(network, window).eval()  # the exporter brings all parts back to the mode of the whole
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it says of constants and of itself
        torch.onnx.export(
            exported,
            (window.past, window.lead_s),
            path,
            dynamo=False,
            opset_version=OPSET,
            input_names=["past", "lead_s"],
            output_names=["logits"],
        )


def quantise(path: Path, out: Path, windows: Sequence[WindowBatch]) -> None:
    """Quantise the convolutions of an ONNX file, the ranges of their inputs from windows."""
    from onnxruntime import quantization

    logging.disable(logging.WARNING)  # it recommends steps that the exporter has done
    inputs = inputs_of(path)
    feeds = iter([feed(window, inputs) for window in windows])

    class Reader(quantization.CalibrationDataReader):  # type: ignore[misc] # ONNX Runtime has no types
        def get_next(self) -> dict[str, Any] | None:
            return next(feeds, None)

    quantization.quantize_static(
        path,
        out,
        Reader(),
        quant_format=quantization.QuantFormat.QDQ,
        op_types_to_quantize=["Conv", "Relu", "MaxPool", "Concat", "Resize", "Add"],
        per_channel=True,
        reduce_range=not any(name in instructions() for name in VNNI),  # else products of int8 saturate
        calibrate_method=quantization.CalibrationMethod.MinMax,
    )


def inputs_of(path: Path) -> list[str]:
    """Return what an ONNX file asks for: a network that is not told leads has none."""
    return [each.name for each in open_model(path, "cpu", 1).session.get_inputs()]


def feed(window: WindowBatch, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return what a window says under these names."""
    return {name: getattr(window, name).numpy() for name in names}


class Runtime:
    """Answers by an ONNX file."""

    def __init__(self, path: Path, threads: int) -> None:
        self._session, self._names = open_model(path, "cpu", threads).session, inputs_of(path)

    def __call__(self, window: WindowBatch) -> NDArray[np.uint8]:
        """Return the classes of a window."""
        (logits,) = self._session.run(None, feed(window, self._names))
        return torch.from_numpy(logits)[0].argmax(dim=0).to(torch.uint8).numpy()  # as PyTorch's ways do


def by_torch(scores: Callable[[WindowBatch], Tensor]) -> Answer:
    """Make a way to answer of what scores a window."""

    def answer(window: WindowBatch) -> NDArray[np.uint8]:
        with torch.inference_mode():
            return scores(window)[0].argmax(dim=0).to(torch.uint8).numpy()

    return answer


def compared(answers: dict[str, Answer], windows: Sequence[WindowBatch]) -> Iterator[Way]:
    """Answer all windows in all ways in turn, and compare each way with the first."""
    for answer in answers.values():
        answer(windows[0])  # plans and allocates
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in answers}
    classes: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in answers}
    for window in windows:
        for name, answer in answers.items():
            began = time.perf_counter(), time.process_time()
            classes[name].append(answer(window))
            taken[name].append((time.perf_counter() - began[0], time.process_time() - began[1]))
    target, left_out = (torch.cat([getattr(each, what) for each in windows]).numpy() for what in ("target", "mask"))
    plain_s, plain = np.array(taken[PLAIN]), np.stack(classes[PLAIN])
    for name in answers:
        seconds, found = np.array(taken[name]), np.stack(classes[name])
        wall_ms, cpu_ms = (1e3 * median(column) for column in seconds.T)
        wall_times, cpu_times = (float(median(column)) for column in (plain_s / seconds).T)
        counts = confusion(target, found, left_out, IOU.classes.count).sum(axis=0)
        iou = IOU.means(class_iou(counts))["mean_known"]
        equal_percent = 100.0 * float((found == plain).mean())
        yield Way(name, wall_ms, cpu_ms, wall_times, cpu_times, equal_percent, float(iou))


def table(name: str, ways: Sequence[Way]) -> Iterator[str]:
    """Show what became of all ways in Markdown."""
    yield f"\n| {name} | ms | ms CPU | times as fast | by CPU time | cells of equal class, % | mean (known) |"
    yield "|---|---|---|---|---|---|---|"
    for way in ways:
        short = "" if way.equal_percent >= GOAL_PERCENT else f", short of {GOAL_PERCENT:g}"
        numbers = f"{way.wall_ms:.1f} | {way.cpu_ms:.1f} | {way.wall_times:.2f} | {way.cpu_times:.2f}"
        yield f"| {way.name} | {numbers} | {way.equal_percent:.2f}{short} | {way.mean_iou:.4f} |"


def instructions() -> str:
    """Name the instructions of this processor that int8 and bf16 live by."""
    flags = cpu_facts().get("flags", "").split()
    return ", ".join(name for name in ("avx2", "avx512f", *VNNI, "avx512_bf16") if name in flags) or "no AVX"


def parser() -> argparse.ArgumentParser:
    """Describe the options."""
    top = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    top.add_argument("matrix", help="whose rows are tried: networks, of any kind")
    top.add_argument("--logs", type=Path, required=True)
    top.add_argument("--out", type=Path, required=True, help="folder of a run: trainings and grids are found there")
    top.add_argument("--grids", type=Path, help="folder of grids (default: OUT/grids)")
    top.add_argument("--windows", type=int, default=120, help="scored, at most")
    top.add_argument("--calibrated", type=int, default=64, help="windows of the training split, at most")
    top.add_argument("--threads", type=int, default=1)
    return top


if __name__ == "__main__":
    sys.exit(main())
