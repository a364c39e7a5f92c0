"""Where independent pieces of work run: one after the other here, or in several processes of this machine.

Whatever has the form of `Executor` can take the place of these two, for example a cluster's.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from ctypes import Array, c_byte
    from multiprocessing.sharedctypes import Synchronized

T = TypeVar("T")
R = TypeVar("R")

_CONTEXT = multiprocessing.get_context("spawn")  # a fork would copy whatever threads and locks the caller holds
# Libraries read these once, when they are first imported; each worker gets its share of the cores.
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class WorkerDied:
    """Stands for the result of a piece of work whose process was killed, or that does not fit into memory."""

    reason: str = "a worker process was killed (out of memory?)"


class NoRoomError(Exception):
    """A piece of work does not fit into the memory of its device, perhaps because of others beside it."""


class Executor(Protocol):
    """Applies a function to many items."""

    @property
    def parallel(self) -> int:
        """How many items are worked on at once."""

    @property
    def threads(self) -> int | None:
        """How many threads numeric libraries have for each item; None means as many as in the calling process."""

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield (index of the item, result) as results come; function, items and results must be picklable.

        An exception of the function other than `NoRoomError` ends the iteration; what a user can cause must be part
        of the result.
        """


class InProcess:
    """Works in this process, in order."""

    parallel = 1
    threads = None

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield results in the order of the items."""
        for index, item in enumerate(items):
            try:
                yield index, function(item)
            except NoRoomError as error:
                yield index, WorkerDied(str(error))


class Processes:
    """Works in several fresh processes of this machine, its cores and GPUs shared out among them.

    Args:
        workers: how many processes.
        threads: of numeric libraries in each; by default the cores of the machine divided by `workers`.
        gpus: as CUDA names them; each process sees one, and several share it where there are more processes.
    """

    def __init__(self, workers: int, *, threads: int | None = None, gpus: Sequence[str] = ()) -> None:
        self.parallel = workers
        self.threads = threads or max(1, available_cores() // workers)
        self._gpus = tuple(gpus)

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield results as they come; stopping early drops what has not begun.

        A process that is killed ends all others, too. What was being worked on then is done once more by itself, and
        what had not begun goes on together.
        """
        left, alone = list(range(len(items))), []
        while left:
            begun = _CONTEXT.RawArray("b", len(items))
            lost = []
            for index, result in self._together(function, items, left, begun):
                if isinstance(result, WorkerDied) and len(items) > 1:
                    lost.append(index)
                else:
                    yield index, result
            suspects = [index for index in lost if begun[index]] or lost
            alone += suspects
            left = [index for index in lost if index not in suspects]
        for index in alone:
            yield from self._together(function, items, [index], _CONTEXT.RawArray("b", len(items)))

    def _together(
        self, function: Callable[[T], R], items: Sequence[T], chosen: Sequence[int], begun: "Array[c_byte]"
    ) -> Iterator[tuple[int, R | WorkerDied]]:
        """Work on the chosen items; of each one whose turn has come, `begun` is 1."""
        pool = ProcessPoolExecutor(
            min(self.parallel, len(chosen)),
            mp_context=_CONTEXT,
            initializer=_start_worker,
            initargs=(self.threads, self._gpus, _CONTEXT.Value("i", 0), begun),
        )
        try:
            futures: dict[Future[R], int] = {}
            for index in chosen:
                try:
                    futures[pool.submit(_begin, function, items[index], index)] = index
                except BrokenProcessPool:
                    yield index, WorkerDied()
            for future in as_completed(futures):
                try:
                    yield futures[future], future.result()
                except BrokenProcessPool:
                    yield futures[future], WorkerDied()
                except NoRoomError as error:
                    yield futures[future], WorkerDied(str(error))
        finally:
            pool.shutdown(cancel_futures=True)


def local_executor(workers: int, *, gpus: Sequence[str] = ()) -> Executor:
    """Choose between this process and several, among which GPUs are shared out."""
    return InProcess() if workers <= 1 else Processes(workers, gpus=gpus)


def available_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_variables(threads: int) -> dict[str, str]:
    """Return what the environment of a new process must hold for its numeric libraries to have that many threads."""
    return dict.fromkeys(_THREAD_VARIABLES, str(threads))


_begun: "Array[c_byte] | None" = None  # in a worker: marks the items whose turn has come


def _start_worker(threads: int, gpus: tuple[str, ...], started: "Synchronized[int]", begun: "Array[c_byte]") -> None:
    global _begun  # shared memory reaches a process only when it starts
    _begun = begun
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # Ctrl-C stops the parent alone: it drops what waits, and what is being written is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(thread_variables(threads))
    with started.get_lock():
        number, started.value = started.value, started.value + 1
    if gpus:
        os.environ["CUDA_VISIBLE_DEVICES"] = gpus[number % len(gpus)]


def _end_with_parent() -> None:
    """Leave at once when the parent has ended, however it did: nobody is there to take a result."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _begin(function: Callable[[T], R], item: T, index: int) -> R:
    assert _begun is not None
    _begun[index] = 1
    return function(item)
