"""Asks models of one's own, each in a process apart that is started when needed, and knows what they have said."""

import atexit
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from semgrid_eval.apart import Apart, ApartError
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.models.device import memory_words
from semgrid_eval.models.model import Model
from semgrid_eval.progress import Progress, silent
from semgrid_eval.workplace import Limits

_log = logging.getLogger(__name__)
_GUEST = "semgrid_eval.models.guest"
_MOST_GUESTS = 3  # that wait for questions at once; each has torch in memory


class Host:
    """Asks a model of one's own, in a process that is started when it is needed."""

    def __init__(self, name: str, limits: Limits) -> None:
        self.name, self.limits = name, limits
        self.known: dict[str, dict[str, Any]] = {}  # answers, by questions
        self.stand_in: type[Model] | None = None
        self.state = ""  # of its code, when it was described
        self._guest: Apart | None = None

    def recall(self, what: str, **given: Any) -> Any:  # noqa: ANN401 - of what is asked
        """Ask something that is answered once for all: with what was found, or by the end of the process.

        What the code raises, it may not raise again: the process is there, and is asked.
        """
        key = digest_value([what, repr(given)])
        if key not in self.known:
            try:
                self.known[key] = {"found": self.ask(what, **given)[0]}
            except MemoryError as error:
                raise InputError(memory_words(error), field=self.name) from error
            except InputError as error:
                if not isinstance(error.__cause__, ApartError):
                    raise
                self.known[key] = {"ended": str(error.__cause__)}
        if "ended" in self.known[key]:
            raise InputError(self.known[key]["ended"], field=self.name)
        return self.known[key]["found"]

    def ask(self, what: str, *, limit_bytes: int = 0, progress: Progress = silent, **given: Any) -> tuple[Any, bytes]:  # noqa: ANN401 - of what is asked
        """Ask something that is to be done now, and return what was found and its bytes.

        Raises:
            InputError: the code raised something, or its process has ended.
            MemoryError: it does not fit into memory.
        """
        try:
            answer, content = self._running().ask(
                (self.name, what, given), limit_bytes=limit_bytes, hear=_listener(progress)
            )
        except ApartError as error:
            raise InputError(str(error), field=self.name) from error
        if "found" not in answer:
            self._fail(answer)
        return answer["found"], content

    def end(self) -> None:
        """End the process, if there is one."""
        atexit.unregister(self.end)
        if self._guest is not None:
            self._guest.close()
            self._guest = None

    @property
    def is_running(self) -> bool:
        """Whether there is a process."""
        return self._guest is not None and self._guest.is_alive

    def _running(self) -> Apart:
        if self._guest is None or not self._guest.is_alive:
            self.end()
            others = [host for host in _hosts.values() if host is not self and host.is_running]
            for other in others[: len(others) - _MOST_GUESTS + 1]:
                other.end()
            atexit.register(self.end)
            self._guest = Apart(_GUEST, self.limits)
        return self._guest

    def _fail(self, answer: dict[str, Any]) -> NoReturn:
        text = str(answer.get("text"))
        if answer.get("fault") == "memory":
            self.end()  # so that what it holds is free again
            raise MemoryError(text)
        error = (ConfigError if answer.get("fault") == "config" else InputError)(text)
        error.path = None if answer.get("path") is None else Path(str(answer["path"]))
        error.field = None if answer.get("field") is None else str(answer["field"])
        raise error


_hosts: dict[str, Host] = {}


def current_host(name: str, limits: Limits) -> Host:
    """Return who asks a model of one's own, of the code as it is now."""
    host = _hosts.get(name)
    if host is None or host.limits != limits or host.state != code_state(host):
        if host is not None:
            host.end()
        host = _hosts[name] = Host(name, limits)
    return host


def end_guests() -> None:
    """End all processes apart."""
    for host in _hosts.values():
        host.end()


def known_answers() -> str:
    """Return what models have said of themselves, as `learn_answers` takes it."""
    return json.dumps({name: [host.state, host.known] for name, host in _hosts.items()}, sort_keys=True)


def learn_answers(known: str, limits: Limits) -> None:
    """Learn what another process knows, so that no code is run to ask it again."""
    for name, (state, answers) in json.loads(known).items():
        host = _hosts.setdefault(name, Host(name, limits))
        host.state, host.known = state, {**answers, **host.known}


def code_state(host: Host) -> str:
    """Digest the code that was described; of what could not be loaded, names and times of what lies beside it."""
    try:
        return digest_files([Path(file) for file in host.recall("describe")["sources"]]) if host.known else ""
    except InputError:
        beside = sorted(Path(host.name.rpartition(":")[0]).parent.glob("*.py")) if ":" in host.name else []
        return digest_value([[str(file), file.stat().st_mtime_ns, file.stat().st_size] for file in beside])


def _listener(progress: Progress) -> Callable[[dict[str, Any]], None]:
    """Return who is told of what a guest says before it answers."""

    def hear(said: dict[str, Any]) -> None:
        if "warning" in said:
            _log.warning("%s", said["warning"])
        if isinstance(step := said.get("progress"), list) and [type(each) for each in step] == [int, int, str]:
            progress(*step)

    return hear
