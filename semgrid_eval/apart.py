"""A process apart, which may fail in any way without harm here: one question at a time, each answered within limits."""

import json
import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from semgrid_eval.errors import SemgridError
from semgrid_eval.workplace import Limits

_SIZES = struct.Struct("<QQ")
_HEAD_LIMIT_BYTES = 64 << 20
_LOOK_S = 1.0  # how often to look whether the process is still there, as another may hold its end of the connection
_GRACE_S = 5.0  # for a process to end by itself
_START = """\
import json, sys
given = json.loads(sys.argv[1])
sys.path[:], sys.argv[:] = given["path"], [""]
from semgrid_eval.apart import settle_apart
settle_apart(given["parent"], given["memory_bytes"])
from importlib import import_module
import_module(given["module"]).serve(given["descriptor"])
"""


class ApartError(SemgridError):
    """The process ended, or was ended, before it had answered; the message goes on after a name."""


class Apart:
    """A Python process that serves questions with a module's `serve`, in a session of its own.

    What it prints goes to the standard error. Where the questions are asked from, nothing of what it sends is run: an
    answer is JSON and bytes.
    """

    def __init__(self, module: str, limits: Limits) -> None:
        self._limits = limits
        self._channel, theirs = socket.socketpair()
        given = {
            "path": sys.path,
            "module": module,
            "descriptor": theirs.fileno(),
            "parent": os.getpid(),
            "memory_bytes": limits.memory_bytes,
        }
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, json.dumps(given)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL if sys.__stderr__ is None else 2,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )

    @property
    def is_alive(self) -> bool:
        """Whether it can be asked."""
        return self._channel.fileno() >= 0 and not self._has_ended()

    def ask(
        self, question: object, *, limit_bytes: int = 0, hear: Callable[[dict[str, Any]], None] | None = None
    ) -> tuple[dict[str, Any], bytes]:
        """Ask, and wait for the answer and its bytes, at most so many; `hear` is told what is said before it.

        Raises:
            ApartError: there is none; the process has ended.
        """
        try:
            self._send(pickle.dumps(question))
            while True:
                head, content = self._receive(limit_bytes)
                if "answer" in head:
                    return head["answer"], content
                if hear is not None:
                    hear(head)
        except BaseException:  # what comes next would answer another question
            self.close()
            raise

    def close(self) -> None:
        """End the process, and all that it has started in its session."""
        self._channel.close()
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _send(self, content: bytes) -> None:
        end_s = self._end_s()
        left = memoryview(_SIZES.pack(0, len(content)) + content)
        while left:
            try:
                self._channel.settimeout(self._slice_s(end_s))
                left = left[self._channel.send(left) :]
            except TimeoutError:
                self._look(end_s)
            except OSError:
                raise self._ended() from None

    def _receive(self, limit_bytes: int) -> tuple[dict[str, Any], bytes]:
        end_s = self._end_s()
        head_bytes, content_bytes = _SIZES.unpack(self._exactly(_SIZES.size, end_s))
        if head_bytes > _HEAD_LIMIT_BYTES or content_bytes > limit_bytes:
            raise ApartError("sent what is not an answer to the run")
        content = self._exactly(head_bytes, end_s), self._exactly(content_bytes, end_s)
        try:
            head = json.loads(content[0])
        except (ValueError, RecursionError):
            head = None
        if not isinstance(head, dict):
            raise ApartError("sent what is not an answer to the run")
        return head, content[1]

    def _exactly(self, count: int, end_s: float) -> bytes:
        parts: list[bytes] = []
        while count:
            try:
                self._channel.settimeout(self._slice_s(end_s))
                parts.append(self._channel.recv(min(count, 1 << 22)))
            except TimeoutError:
                self._look(end_s)
                continue
            except OSError:
                raise self._ended() from None
            if not parts[-1]:
                raise self._ended()
            count -= len(parts[-1])
        return b"".join(parts)

    def _end_s(self) -> float:
        limit_s = self._limits.time_s
        return time.monotonic() + limit_s if limit_s is not None else float("inf")

    @staticmethod
    def _slice_s(end_s: float) -> float:
        return max(0.001, min(_LOOK_S, end_s - time.monotonic()))

    def _look(self, end_s: float) -> None:
        """Raise an error where there is nothing to wait for any more."""
        if self._has_ended():
            raise self._ended()
        if time.monotonic() >= end_s:
            raise ApartError(f"gave no sign for {self._limits.time_s:g} s and was ended (--time-limit)")

    def _has_ended(self) -> bool:
        """Tell whether the process has ended; its number stays its own until `close`."""
        if self._process.returncode is not None:
            return True
        with suppress(ChildProcessError):
            return os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG) is not None
        return True

    def _ended(self) -> ApartError:
        """Say how the process has ended, for which it is given a moment."""
        end_s = time.monotonic() + _GRACE_S
        while not self._has_ended() and time.monotonic() < end_s:
            time.sleep(0.02)
        if not self._has_ended():
            return ApartError("closed its connection to the run")
        self.close()
        code = self._process.returncode
        if code >= 0:
            return ApartError(f"ended its process with exit code {code}")
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return ApartError(f"was killed by {name}{' (out of memory?)' if name == 'SIGKILL' else ''}")


class Channel:
    """The end of the connection where questions are answered."""

    def __init__(self, descriptor: int) -> None:
        self._socket, self._process = socket.socket(fileno=descriptor), os.getpid()

    def question(self) -> Any:  # noqa: ANN401 - whatever is asked
        """Wait for a question; an EOFError says that there is none any more."""
        _, size = _SIZES.unpack(self._exactly(_SIZES.size))
        return pickle.loads(self._exactly(size))

    def say(self, head: dict[str, Any], content: bytes = b"") -> None:
        """Send JSON and bytes: what holds `answer` ends a question."""
        if os.getpid() != self._process:  # a copy that code of one's own has made, and let return
            os._exit(1)
        text = json.dumps(head).encode()
        self._socket.sendall(_SIZES.pack(len(text), len(content)) + text)
        self._socket.sendall(content)

    def _exactly(self, count: int) -> bytes:
        found = bytearray()
        while len(found) < count:
            part = self._socket.recv(min(count - len(found), 1 << 22))
            if not part:
                raise EOFError
            found += part
        return bytes(found)


def settle_apart(parent: int, memory_bytes: int | None) -> None:
    """Set what holds for a process apart: it ends with its parent, stays within its memory, and leaves no core file."""
    import ctypes
    import resource
    import threading

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG, on Linux
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()  # on other systems
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_bytes is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    with suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:  # noqa: PTH123 - before all else
        file.write("1000")  # where memory ends all the same, this process is the one to go


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)
