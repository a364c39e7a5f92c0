"""Command lines that a reader can copy: how to make a row again, and how to play a window's recording."""

import shlex
from itertools import pairwise


def row_command(command: str, row: str, matrix: str) -> str:
    """Return the command line that makes one row: the run's own, narrowed to it, or one that reads the matrix file."""
    words = _words(command) or ["semgrid-eval", "run", matrix, "--logs", "LOGS", "--out", "RUN"]
    kept, skip = [], False
    for word in words:
        if not skip and word != "--row" and not word.startswith("--row="):
            kept.append(word)
        skip = not skip and word == "--row"
    return shlex.join([*kept, "--row", row])


def play_command(command: str, row: str, recording: str) -> str:
    """Return the command line that plays a recording of a row, with the folders that the run's own names."""
    spread = [part for word in _words(command) for part in (word.split("=", 1) if word.startswith("--") else [word])]
    found = {name: value for name, value in pairwise(spread) if name.startswith("--")}
    logs = found.get("--validation-logs", found.get("--logs", "LOGS"))
    where = [found.get("--out", "RUN"), row, "--logs", logs]
    return shlex.join(["semgrid-eval", "play", *where, "--recording", recording, "--out", "play.mcap"])


def _words(command: str) -> list[str]:
    """Split a run's command line as a shell does; empty where it is none."""
    try:
        words = shlex.split(command)
    except ValueError:  # it was not written by a shell's rules
        return []
    return words if words[:2] == ["semgrid-eval", "run"] else []
