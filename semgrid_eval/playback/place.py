"""Where a play log may be written: over an earlier one of its kind and nothing else, and never among recordings."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log.codec import PLAYBACK_RECORD
from semgrid_eval.log.container import Container
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import SUFFIX

LAYOUT = "layout"
"""The entry of a play log's metadata record that holds the digest of the layout which was written beside it."""
_ADVICE = "name another file, or replace it with --force"


def require_place(out: Path, layout: Path, text: str, logs: Iterable[str], *, force: bool) -> None:
    """Make sure that writing a play log, and `text` as the layout beside it, loses nothing that is somebody else's.

    Args:
        out: the log.
        layout: the file of the layout.
        text: what is to be written there.
        logs: paths of the run's logs below their folder, wherever it is.
        force: replace what is there all the same; a folder of logs stays closed.

    Raises:
        InputError: it would.
    """
    if _is_among_logs(out, logs):
        raise InputError("lies in a folder of logs, where it would be taken for one", path=out)
    if force:
        return
    earlier = _metadata(out) if out.exists() else {}
    if earlier is None:
        raise InputError(f"exists and is not a log of `play`; {_ADVICE}", path=out)
    if layout.exists() and digest_of(layout.read_bytes()) not in (digest_of(text.encode()), earlier.get(LAYOUT)):
        raise InputError(f"exists and is not a layout of `play`, or was changed; {_ADVICE}", path=layout)


def digest_of(content: bytes) -> str:
    """Digest a layout."""
    return hashlib.sha256(content).hexdigest()


def _metadata(out: Path) -> dict[str, str] | None:
    try:
        with Container(out) as log:
            return log.metadata(PLAYBACK_RECORD)
    except LogError:
        return None


def _is_among_logs(out: Path, logs: Iterable[str]) -> bool:
    """Tell whether a path is below a folder that holds one of the run's logs, or beside any recording."""
    place = out.resolve()
    if any((folder / path).exists() for path in logs for folder in place.parents):
        return True
    others = (path for path in place.parent.glob(f"*{SUFFIX}") if path != place)
    return any(map(_is_recording, others))


def _is_recording(path: Path) -> bool:
    try:
        LogReader(path).close()
    except LogError:
        return False
    return True
