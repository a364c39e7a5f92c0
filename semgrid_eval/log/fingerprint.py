"""Fingerprints of what logs say, whatever version of the package or of the compression wrote them."""

import hashlib
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from semgrid_eval.errors import LogError, ResultError
from semgrid_eval.executors import Executor, WorkerDied
from semgrid_eval.files import DIGEST_CHARACTERS
from semgrid_eval.log.reader import LogReader
from semgrid_eval.progress import Progress
from semgrid_eval.seals import read_sealed_json, write_sealed_json

R = TypeVar("R")
KEPT = "fingerprints.json"
_OWNER = "fingerprints"
_MESSAGE = struct.Struct("<qQ")


def fingerprint(path: Path) -> str:
    """Digest the messages of a log: topics, times and bytes in the order of time (16 hexadecimal characters).

    `LogReader.digest` also depends on versions, compression and metadata; this does not.

    Raises:
        LogError: the log cannot be read or is damaged.
    """
    total = hashlib.sha256()
    with LogReader(path) as log:
        for topic, stamp_ns, data, _ in log.messages(log.schemas()):
            total.update(topic.encode() + b"\0")
            total.update(_MESSAGE.pack(stamp_ns, len(data)))
            total.update(data)
    return total.hexdigest()[:DIGEST_CHARACTERS]


def fingerprints(paths: Sequence[Path], *, executor: Executor, progress: Progress) -> list[str]:
    """Return the fingerprints of several logs, in their order.

    Raises:
        LogError: a log cannot be read or is damaged.
    """
    found = [""] * len(paths)
    for index, outcome in _outcomes(fingerprint, paths, executor, progress):
        if isinstance(outcome, WorkerDied):
            raise LogError(outcome.reason, path=paths[index])
        found[index] = outcome
    return found


def kept_fingerprints(
    logs: Mapping[str, Path], cache: Path, *, executor: Executor, progress: Progress
) -> dict[str, str]:
    """Return the fingerprints of logs by their digests; a log that is damaged somewhere has none.

    The folder `cache` keeps what was found, so that it is found once.
    """
    kept = _kept(cache / KEPT)
    missing = [digest for digest in logs if digest not in kept]
    try:
        paths = [logs[digest] for digest in missing]
        for index, outcome in _outcomes(_fingerprint_if_sound, paths, executor, progress):
            if isinstance(outcome, str):
                kept[missing[index]] = outcome
    finally:
        if missing:
            write_sealed_json(cache / KEPT, kept, _OWNER)
    return {digest: kept[digest] for digest in logs if digest in kept}


def _outcomes(
    function: Callable[[Path], R], paths: Sequence[Path], executor: Executor, progress: Progress
) -> Iterator[tuple[int, R | WorkerDied]]:
    for done, (index, outcome) in enumerate(executor.run(function, paths), start=1):
        yield index, outcome
        progress(done, len(paths), paths[index].stem)


def _kept(path: Path) -> dict[str, str]:
    try:
        return read_sealed_json(path, _OWNER)
    except ResultError:  # not made yet, or damaged
        return {}


def _fingerprint_if_sound(path: Path) -> str | None:
    try:
        return fingerprint(path)
    except LogError:
        return None
