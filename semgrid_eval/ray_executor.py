"""Ray as an executor: the same units of work on the machines of a cluster, results written to shared storage."""

import atexit
import importlib
import logging
import os
import secrets
import shutil
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from semgrid_eval.errors import InputError, MissingExtraError, first_line
from semgrid_eval.executors import NoRoomError, WorkerDied, thread_variables
from semgrid_eval.files import locked
from semgrid_eval.workplace import LOCAL

_log = logging.getLogger(__name__)

T = TypeVar("T")
R = TypeVar("R")

CONNECTION_TIMEOUT_S = 5.0
_LOOPBACK = "127.0.0.1"
_PROBE = ".shared"  # a file that all machines must see, for a moment
# Ray reads these when it is imported. Where the first is off, addresses of this machine stay on its loopback interface;
# whoever connects has to know the token, which is passed on by the environment alone.
_KEPT_HERE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_AUTH_MODE": "token"}
_TOKEN = "RAY_AUTH_TOKEN"

# Ray's errors where a worker, its machine or the result there is gone; the last is the base of several.
_LOST = (
    "WorkerCrashedError",
    "OutOfMemoryError",
    "LocalRayletDiedError",
    "NodeDiedError",
    "TaskUnschedulableError",
    "ObjectLostError",
)


class RayExecutor:
    """Works on a Ray cluster; the folders of logs, grids and the run must be reachable from all its machines.

    One that is started here listens on the loopback interface alone, asks for a token that this process has drawn, and
    keeps its files in a folder of this user.

    Args:
        address: of a running cluster (`auto` finds the one of this machine), or `local` to start one here.
        cpus: cores for each piece of work; its numeric libraries have as many threads, and one at least.
        gpus: GPUs for each piece of work; a fraction lets several share one.
        local_cpus: cores of a cluster that is started here; all of them if not given.

    Raises:
        MissingExtraError: Ray is not installed.
        InputError: the cluster cannot be reached, never has what a piece of work asks for, or listens to others when it
            is started here.
    """

    def __init__(
        self, address: str = LOCAL, *, cpus: float = 1.0, gpus: float = 0.0, local_cpus: int | None = None
    ) -> None:
        self._folder: Path | None = None  # of a cluster that is started here
        self._cpus, self._gpus = cpus, gpus
        if address == LOCAL:
            keep_to_this_machine()
        try:
            self._ray: Any = importlib.import_module("ray")  # an extra, and untyped
        except ImportError:
            raise MissingExtraError("ray", "ray") from None
        if not self._ray.is_initialized():
            self._start(local_cpus) if address == LOCAL else self._connect(address)
        resources = self._ray.cluster_resources()
        for name, needed in (("CPU", cpus), ("GPU", gpus)):
            if needed > resources.get(name, 0.0):
                raise InputError(f"has {resources.get(name, 0.0):g} {name}, and a row asks for {needed:g}", field="ray")

    @property
    def parallel(self) -> int:
        """How many pieces of work fit on the cluster at once, at least 2: they never run in this process."""
        return max(2, int(self._ray.cluster_resources().get("CPU", 1.0) / max(self._cpus, 0.01)))

    @property
    def threads(self) -> int:
        """How many threads numeric libraries have for each piece of work, whatever the machine it runs on says."""
        return max(1, int(self._cpus))

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield (index of the item, result) as results come; leaving early cancels what has not begun."""
        environment = {"env_vars": thread_variables(self.threads)}
        options = {"num_cpus": self._cpus, "num_gpus": self._gpus, "max_retries": 1, "runtime_env": environment}
        remote = self._ray.remote(**options)(_apply)
        pending = {remote.remote(function, item, str(Path.cwd())): index for index, item in enumerate(items)}
        try:
            while pending:
                finished, _ = self._ray.wait(list(pending), num_returns=1)
                index = pending.pop(finished[0])
                yield index, self._result(finished[0])
        finally:
            for reference in pending:
                self._ray.cancel(reference)

    def check_shared(self, read: Sequence[Path], written: Path) -> None:
        """Make sure that every machine that works sees what is read, and the folder that is written, which is made.

        Raises:
            InputError: one of them does not, under the same path; or the folder cannot be written.
        """
        with locked(written, _PROBE):
            paths = [path.absolute() for path in (*read, written / _PROBE)]
            machines = [node for node in self._ray.nodes() if node["Alive"] and node["Resources"].get("CPU")]
            asked = {self._ask(node["NodeID"], paths): node["NodeManagerHostname"] for node in machines}
            for reference, host in asked.items():
                unseen = self._result(reference)
                if unseen and not isinstance(unseen, WorkerDied):  # whoever dies does no work either
                    path = [*read, written][unseen[0]]
                    fault = f"is not seen by the machine {host}; all of a cluster must reach it under this path"
                    raise InputError(fault, path=path, field="ray")

    def _ask(self, node: str, paths: Sequence[Path]) -> Any:  # noqa: ANN401 - Ray is untyped
        strategies = importlib.import_module("ray.util.scheduling_strategies")
        there = strategies.NodeAffinitySchedulingStrategy(node, soft=False)
        return self._ray.remote(num_cpus=0, scheduling_strategy=there)(_unseen).remote(paths)

    def close(self) -> None:
        """Leave the cluster, and stop it if it was started here."""
        self._ray.shutdown()
        atexit.unregister(self.close)
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    def _result(self, reference: Any) -> Any:  # noqa: ANN401 - Ray is untyped
        try:
            return self._ray.get(reference)
        except NoRoomError as error:
            return WorkerDied(str(error.cause))  # type: ignore[attr-defined] # Ray's copy has the original as its cause
        except tuple(getattr(self._ray.exceptions, name) for name in _LOST) as error:
            return WorkerDied(first_line(error))

    def _start(self, cpus: int | None) -> None:
        """Start a cluster that nobody else can reach: not from other machines, and not as another user of this one."""
        atexit.register(self.close)
        self._folder = Path(tempfile.mkdtemp(prefix="semgrid-ray-"))  # Ray lets everybody write into those below it
        self._initialise(LOCAL, num_cpus=cpus, _node_ip_address=_LOOPBACK, _temp_dir=str(self._folder / "ray"))
        address = str(self._ray.get_runtime_context().gcs_address)
        if not address.startswith(f"{_LOOPBACK}:"):
            self.close()
            fault = (
                f"this version of Ray listens on {address}, which other machines may reach; start a cluster yourself"
            )
            raise InputError(f"{fault} and give its --address", field="ray")

    def _connect(self, address: str) -> None:
        _check_reachable(address)
        self._initialise(address, address=address)

    def _initialise(self, name: str, **options: Any) -> None:  # noqa: ANN401 - Ray is untyped
        try:
            self._ray.init(**options, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
            # What Ray has to say of machines that are lost would go to the standard output, among the results.
            self._ray._private.worker.print_to_stdstream = _note
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            self.close()
            raise InputError(f"cannot be reached: {first_line(error)}", field=f"ray {name}") from error


def keep_to_this_machine() -> None:
    """Set, before Ray is imported, what keeps others out of a cluster that is started here."""
    if "ray" in sys.modules and any(os.environ.get(name) != value for name, value in _KEPT_HERE.items()):
        settings = " ".join(f"{name}={value}" for name, value in _KEPT_HERE.items())
        raise InputError(f"was imported before it was told to listen to this machine alone ({settings})", field="ray")
    os.environ.update(_KEPT_HERE)
    os.environ.setdefault(_TOKEN, secrets.token_hex(32))


def _apply(function: Callable[[T], R], item: T, folder: str) -> R:
    """Call the function where paths mean what they mean here; Ray takes plain functions only, no partial ones."""
    with suppress(OSError):  # another machine may lack the folder, and whole paths need none
        os.chdir(folder)
    return function(item)


def _unseen(paths: Sequence[Path]) -> list[int]:
    """Return which of the paths are not there."""
    return [number for number, path in enumerate(paths) if not path.exists()]


def _note(data: Mapping[str, Any], *_: object, **__: object) -> None:
    """Take a message of Ray in place of its printing."""
    _log.info("ray: %s", "; ".join(line.partition("\n")[0] for line in data["lines"]))


def _check_reachable(address: str) -> None:
    """Ask the port of `host:port` once: Ray itself would go on asking for minutes."""
    host, separator, port = address.removeprefix("ray://").rpartition(":")
    if not separator or not port.isdigit():
        return
    try:
        socket.create_connection((host, int(port)), timeout=CONNECTION_TIMEOUT_S).close()
    except OSError as error:
        raise InputError(f"cannot be reached: {error}", field=f"ray {address}") from error
