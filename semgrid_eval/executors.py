"""Where independent pieces of work run: one after the other here, or in several processes of this machine.

Whatever has the form of `Executor` can take the place of these two, for example a cluster's.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")

# Libraries read these once, when they are first imported; each worker gets its share of the cores.
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class WorkerDied:
    """Stands for the result of a piece of work whose process was killed."""

    reason: str = "a worker process was killed (out of memory?)"


class Executor(Protocol):
    """Applies a function to many items."""

    @property
    def parallel(self) -> int:
        """How many items are worked on at once."""

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield (index of the item, result) as results come; function, items and results must be picklable.

        An exception of the function ends the iteration; what a user can cause must be part of the result.
        """


class InProcess:
    """Works in this process, in order."""

    parallel = 1

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield results in the order of the items."""
        for index, item in enumerate(items):
            yield index, function(item)


class Processes:
    """Works in several fresh processes of this machine, the cores shared out among them.

    Args:
        workers: how many processes.
        threads: of numeric libraries in each; by default the cores of the machine divided by `workers`.
    """

    def __init__(self, workers: int, *, threads: int | None = None) -> None:
        self.parallel = workers
        self._threads = threads or max(1, available_cores() // workers)

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield results as they come; stopping early drops what has not begun."""
        # Fresh processes: a fork would copy whatever threads and locks the caller holds.
        pool = ProcessPoolExecutor(
            min(self.parallel, max(1, len(items))),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start_worker,
            initargs=(self._threads,),
        )
        try:
            futures: dict[Future[R], int] = {pool.submit(function, item): i for i, item in enumerate(items)}
            for future in as_completed(futures):
                try:
                    yield futures[future], future.result()
                except BrokenProcessPool:
                    yield futures[future], WorkerDied()
        finally:
            pool.shutdown(cancel_futures=True)


def local_executor(workers: int) -> Executor:
    """Choose between this process and several."""
    return InProcess() if workers <= 1 else Processes(workers)


def available_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start_worker(threads: int) -> None:
    # Ctrl-C stops the parent alone: it drops what waits, and what is being written is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in _THREAD_VARIABLES:
        os.environ[name] = str(threads)
