"""Measures a GPU: the product of matrices, training in several ways beside it, latency, and processes that share it."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median

import torch
from torch import Tensor

from semgrid_eval.bench.measurement import Measurement
from semgrid_eval.bench.networks import encoder_decoder, flops_of_an_update, random_windows
from semgrid_eval.errors import first_line
from semgrid_eval.executors import Processes, WorkerDied
from semgrid_eval.models.device import settle_process, visible_gpus
from semgrid_eval.models.network import Network, autocast
from semgrid_eval.models.training import train

SHARE_GOAL = 35.0
"""Percent of the rate of a product of matrices that training is to reach."""


@dataclass(frozen=True)
class Size:
    """How much is measured; the defaults are the paper's network and batch."""

    features: int = 64
    batch: int = 32
    matrix_rows: int = 8192
    updates: int = 60  # in each of three repeats
    answers: int = 100  # of one window, in each of ten repeats, as the paper times
    sharing: tuple[int, ...] = (2, 4)  # processes at once
    together_s: float = 6.0  # for which they train
    starting_s: float = 20.0  # until all of them have begun


SMOKE = Size(features=2, batch=2, matrix_rows=64, updates=1, answers=1, sharing=())


@dataclass(frozen=True)
class Way:
    """One way to make the same updates."""

    name: str
    compiled: bool = False  # by torch.compile
    graph: bool = False  # one CUDA graph an update
    any_algorithm: bool = False  # the fastest convolutions, whatever the order of their sums, not repeatable ones
    channels_last: bool = True
    dtype: torch.dtype = torch.bfloat16
    tf32: bool = False


WAYS = (
    Way("eager"),
    Way("CUDA graph", graph=True),
    Way("any algorithm, CUDA graph", any_algorithm=True, graph=True),
)
LATER_WAYS = (
    Way("torch.compile", compiled=True),
    Way("torch.compile, CUDA graph", compiled=True, graph=True),
    Way("channels first", channels_last=False),
    Way("tf32", dtype=torch.float32, tf32=True),
    Way("float32", dtype=torch.float32),
    Way("any algorithm, torch.compile, CUDA graph", any_algorithm=True, compiled=True, graph=True),
)
"""Those that take long or matter less."""
ANSWERS = tuple(
    Way(f"{name}{', CUDA graph' if graph else ''}", graph=graph, dtype=dtype, tf32=tf32)
    for name, dtype, tf32 in (
        ("float32", torch.float32, False),
        ("tf32", torch.float32, True),
        ("bf16", torch.bfloat16, False),
    )
    for graph in (False, True)
)


def measure_gpu(size: Size, device: torch.device) -> Iterator[Measurement | str]:
    """Measure everything, what matters most first; what fails, as a compiler may, is told in words."""
    settle_process()
    rate = product_rate(size, device)
    yield Measurement(f"product of bf16 matrices, {size.matrix_rows} rows", rate / 1e12, "Tflop/s")
    yield Measurement("trained by the package", package_rate(size, device), "windows/s")
    seconds_at_best = flops_of_an_update(encoder_decoder(size.features), 1) / rate
    graphs = device.type == "cuda"
    first, later = ([way for way in ways if graphs or not (way.graph or way.compiled)] for ways in (WAYS, LATER_WAYS))
    answers = [way for way in ANSWERS if graphs or not way.graph]
    train_in = partial(_training, size=size, device=device, seconds_at_best=seconds_at_best)
    measures = [
        *((f"trained, {way.name}", partial(train_in, way)) for way in first),
        *((f"answer, {way.name}", partial(_answers, way, size, device)) for way in answers),
        *((f"trained by {count} processes", partial(_sharing, count, size, device)) for count in size.sharing),
        *((f"trained, {way.name}", partial(train_in, way)) for way in later),
    ]
    for what, measure in measures:
        try:
            yield from measure()
        except Exception as error:  # what libraries raise is many things, and the other measurements go on
            yield f"{what}: {type(error).__name__}: {first_line(error)}"


def product_rate(size: Size, device: torch.device) -> float:
    """Return the floating-point operations a second of a large bf16 product: the median of 20, on random data."""
    shape = (size.matrix_rows, size.matrix_rows)
    left, right = (torch.randn(shape, device=device).bfloat16() for _ in range(2))
    seconds = [_seconds(lambda: left @ right, device) for _ in range(23)]
    return 2.0 * size.matrix_rows**3 / median(seconds[3:])


def package_rate(size: Size, device: torch.device) -> float:
    """Return the windows a second of the package's own training."""
    training = {"epochs": 4, "updates_per_epoch": size.updates, "batch": size.batch, "precision": "bf16"}
    network = encoder_decoder(size.features).network(**training)
    with tempfile.TemporaryDirectory() as folder:
        trained = train(network, random_windows(), seed=0, device=device, folder=Path(folder))
    return size.updates * size.batch / median(max(row.seconds, 1e-3) for row in trained.history[1:])


def _training(way: Way, *, size: Size, device: torch.device, seconds_at_best: float) -> Iterator[Measurement]:
    """Train in one way; `seconds_at_best` is what a window would take at the rate of a product of matrices."""
    with _algorithms(way):
        update = update_in(way, size, device)
        seconds = [_seconds(lambda: _repeat(update, size.updates), device) for _ in range(3)]
    rate = size.updates * size.batch / median(seconds)
    yield Measurement(f"trained, {way.name}", rate, "windows/s")
    yield Measurement(f"trained, {way.name}, of the product of matrices", 100 * rate * seconds_at_best, "%")


def update_in(way: Way, size: Size, device: torch.device) -> Callable[[], object]:
    """Make a function that makes one update of a network over the same windows, as the training does; warmed up."""
    network = _network(way, size, device).train()
    windows = random_windows().to(device)
    chosen = torch.arange(size.batch, device=device) % len(windows)
    graphed = {"capturable": True} if way.graph else {}
    optimizer = torch.optim.RMSprop(network.parameters(), lr=1e-3, alpha=0.9, eps=1e-7, **graphed)
    forward = torch.compile(network) if way.compiled else network

    def update() -> None:
        batch = windows.batch(chosen)
        with autocast(device, way.dtype):
            logits = forward(batch)
        loss = network.loss(logits.float(), batch)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()

    return _ready(update, graph=way.graph)


def _answers(way: Way, size: Size, device: torch.device) -> Iterator[Measurement]:
    """Time the classes of one window at a time, waiting for each: the median over ten repeats of their mean."""
    network, windows = _network(way, size, device).eval(), random_windows().to(device)

    def answer() -> Tensor:
        with torch.inference_mode(), autocast(device, way.dtype):
            return torch.as_tensor(network(windows.batch(slice(0, 1)))).argmax(dim=1)

    with _algorithms(way):
        ready = _ready(answer, graph=way.graph)

        def answer_all() -> None:
            for _ in range(size.answers):
                _seconds(ready, device)

        seconds = median(_seconds(answer_all, device) for _ in range(10))
    yield Measurement(f"answer, {way.name}", 1000 * seconds / size.answers, "ms")


def _sharing(count: int, size: Size, device: torch.device) -> Iterator[Measurement]:
    """Let several processes train at the same time, and add up their windows a second."""
    begin_s = time.time() + size.starting_s
    items = [(size, str(device), begin_s, begin_s + size.together_s)] * count
    found = [result for _, result in Processes(count, gpus=visible_gpus()[:1]).run(train_between, items)]
    if not all(isinstance(each, float) and each > 0 for each in found):
        raise RuntimeError(f"they did not train at the same time: {found}")
    total = sum(each for each in found if not isinstance(each, WorkerDied))
    yield Measurement(f"trained by {count} processes", total, "windows/s")


def train_between(item: tuple[Size, str, float, float]) -> float:
    """Train from one time of the clock to another: windows a second, 0 where the beginning was missed."""
    size, name, begin_s, end_s = item
    settle_process()
    device, done = torch.device(name), 0
    update = update_in(WAYS[0], size, device)
    if time.time() > begin_s:
        return 0.0
    time.sleep(max(0.0, begin_s - time.time()))
    while time.time() < end_s:
        _seconds(lambda: _repeat(update, 5), device)
        done += 5
    return done * size.batch / (time.time() - begin_s)


def _network(way: Way, size: Size, device: torch.device) -> Network:
    network = encoder_decoder(size.features).network().to(device)
    memory_format = torch.channels_last if way.channels_last else torch.contiguous_format
    network.to(memory_format=memory_format)  # type: ignore[call-overload] # torch's stubs lack this form
    return network


def _ready(work: Callable[[], object], *, graph: bool) -> Callable[[], object]:
    """Warm up and, if asked for, record one CUDA graph; what is returned does the same work again."""
    if not graph:
        _repeat(work, 3)
        return work
    stream, recorded = torch.cuda.Stream(), torch.cuda.CUDAGraph()  # type: ignore[no-untyped-call]
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        _repeat(work, 3)
    torch.cuda.current_stream().wait_stream(stream)
    with torch.cuda.graph(recorded):
        work()
    return recorded.replay


def _repeat(work: Callable[[], object], times: int) -> None:
    for _ in range(times):
        work()


def _seconds(work: Callable[[], object], device: torch.device) -> float:
    """Time work until the device is done with it."""
    start_s = time.perf_counter()
    work()
    if device.type == "cuda":
        torch.cuda.synchronize(device)
    return time.perf_counter() - start_s


@contextmanager
def _algorithms(way: Way) -> Iterator[None]:
    """Let convolutions be what a way says inside the block."""
    cudnn, matmul = torch.backends.cudnn, torch.backends.cuda.matmul
    before = cudnn.deterministic, cudnn.benchmark, cudnn.allow_tf32, matmul.allow_tf32
    cudnn.deterministic, cudnn.benchmark = not way.any_algorithm, way.any_algorithm
    cudnn.allow_tf32 = matmul.allow_tf32 = way.tf32
    try:
        yield
    finally:
        cudnn.deterministic, cudnn.benchmark, cudnn.allow_tf32, matmul.allow_tf32 = before
