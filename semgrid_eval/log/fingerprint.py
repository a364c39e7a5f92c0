"""Fingerprints of what logs say, whatever version of the package or of the compression wrote them."""

import hashlib
import struct
from collections.abc import Sequence
from pathlib import Path

from semgrid_eval.errors import LogError
from semgrid_eval.executors import Executor, WorkerDied
from semgrid_eval.files import DIGEST_CHARACTERS
from semgrid_eval.log.store import LogReader
from semgrid_eval.progress import Progress

_MESSAGE = struct.Struct("<qQ")


def fingerprint(path: Path) -> str:
    """Digest the messages of a log: topics, times and bytes in the order of time (16 hexadecimal characters).

    `LogReader.digest` also tells versions and compression apart; this does not.

    Raises:
        LogError: the log cannot be read or is damaged.
    """
    total = hashlib.sha256()
    with LogReader(path) as log:
        for topic, stamp_ns, data in log.messages(log.schemas()):
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
    for done, (index, outcome) in enumerate(executor.run(fingerprint, paths), start=1):
        if isinstance(outcome, WorkerDied):
            raise LogError(outcome.reason, path=paths[index])
        found[index] = outcome
        progress(done, len(paths), paths[index].stem)
    return found
