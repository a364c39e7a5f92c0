"""Where independent pieces of work run: one after the other here, or in several processes of this machine.

Whatever has the form of `Executor` can take the place of these two, for example a cluster's.
"""

import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")

_CONTEXT = multiprocessing.get_context("spawn")  # a fork would copy whatever threads and locks the caller holds
# Libraries read these once, when they are first imported; each worker gets its share of the cores.
_LIMITS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
_GRACE_S = 5.0  # for a process to end by itself


@dataclass(frozen=True)
class WorkerDied:
    """Takes the place of the result of a piece of work whose process was killed, or that does not fit into memory."""

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


@dataclass(frozen=True)
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
    """Works in several new processes of this machine, its cores and GPUs shared out among them.

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
        """Yield results as they come; stopping early drops what has not begun and breaks off what has.

        What loses its process, or finds no room beside others, is done once more by itself.
        """
        alone = []
        for index, result in self._together(function, items, range(len(items))):
            if isinstance(result, WorkerDied) and len(items) > 1:
                alone.append(index)
            else:
                yield index, result
        for index in alone:
            yield from self._together(function, items, [index])

    def _together(
        self, function: Callable[[T], R], items: Sequence[T], chosen: Sequence[int]
    ) -> Iterator[tuple[int, R | WorkerDied]]:
        """Work on the chosen items, each in the first process that is free."""
        waiting = deque(chosen)
        workers = [_Worker(self._environment(number)) for number in range(min(self.parallel, len(chosen)))]
        at_work: dict[_Worker, int] = {}

        def begin_next(worker: _Worker) -> None:
            index = waiting.popleft()
            worker.begin(function, items[index])
            at_work[worker] = index

        try:
            for worker in workers:
                begin_next(worker)
            while at_work:
                done = wait([worker.pipe for worker in at_work])
                for worker in [worker for worker in at_work if worker.pipe in done]:
                    index, result = at_work.pop(worker), worker.result()
                    if waiting:
                        begin_next(worker)
                    yield index, result
        finally:
            for worker in workers:
                worker.leave(at_once=worker in at_work)
            end_s = time.monotonic() + _GRACE_S
            for worker in workers:
                worker.join(end_s)

    def _environment(self, number: int) -> dict[str, str]:
        gpu = {"CUDA_VISIBLE_DEVICES": self._gpus[number % len(self._gpus)]} if self._gpus else {}
        return thread_variables(self.threads) | gpu


def local_executor(workers: int, *, gpus: Sequence[str] = ()) -> Executor:
    """Choose between this process and several, among which GPUs are shared out."""
    return InProcess() if workers <= 1 else Processes(workers, gpus=gpus)


def available_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_variables(threads: int) -> dict[str, str]:
    """Return what the environment of a new process must hold for its numeric libraries to have that many threads."""
    return dict.fromkeys(_LIMITS, str(threads))


class _Worker:
    """A process that works on one item at a time; one that dies is replaced when there is more to do."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = environment
        self._start()

    def _start(self) -> None:
        self.pipe, theirs = _CONTEXT.Pipe()
        # A daemon is ended before the interpreter, even where the traceback of an error still holds the iteration.
        self._process = _CONTEXT.Process(target=_serve, args=(theirs, self._environment), daemon=True)
        self._process.start()
        theirs.close()  # so that the pipe ends with the process

    def begin(self, function: Callable[[T], R], item: T) -> None:
        """Hand over an item; the pipe has something to read once it is done or the process dead."""
        if self.pipe.closed:
            self._start()
        work = pickle.dumps((function, item))
        with suppress(ConnectionError):  # it has died, and so says the result
            self.pipe.send_bytes(work)

    def result(self) -> Any:  # noqa: ANN401 - of the function that was handed over
        """Wait for the result of the item, or raise what its function raised."""
        try:
            answer = self.pipe.recv_bytes()
        except (EOFError, OSError):
            self.pipe.close()
            self.join(time.monotonic() + _GRACE_S)
            return WorkerDied()
        result, error = pickle.loads(answer)
        if isinstance(error, NoRoomError):
            return WorkerDied(str(error))
        if error is not None:
            raise error
        return result

    def leave(self, *, at_once: bool) -> None:
        """Let the process end when it waits for work, or at once."""
        self.pipe.close()
        if at_once:
            self._process.terminate()

    def join(self, end_s: float) -> None:
        """Wait until the process has ended, on the monotonic clock at most until then; it is killed after that."""
        self._process.join(max(0.0, end_s - time.monotonic()))
        self._process.kill()
        self._process.join()


def _serve(pipe: Connection, environment: dict[str, str]) -> None:
    """Work on what comes through the pipe until its other end is closed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then ends this process
    signal.signal(signal.SIGTERM, _unwind)
    os.environ.update(environment)
    with suppress(EOFError, ConnectionError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _unwind(_signal: int, _frame: object) -> None:
    """Leave as with an error, so that half-written files are removed."""
    raise SystemExit(1)


def _answer(work: bytes) -> bytes:
    """Work on an item; the answer holds its result and the error that it ended with, one of them None."""
    try:
        function, item = pickle.loads(work)
        return pickle.dumps((function(item), None))
    except Exception as error:
        story = "".join(traceback.format_exception(error))
        error.add_note(f"In a worker process:\n{story}")
        with suppress(Exception):  # not every error can be copied
            answer = pickle.dumps((None, error))
            pickle.loads(answer)
            return answer
        return pickle.dumps((None, RuntimeError(story)))


def _end_with_parent() -> None:
    """Leave at once when the parent has ended, however it did: nobody is there to take a result."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
