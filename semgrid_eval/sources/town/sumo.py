"""Runs the tools of Eclipse SUMO and passes their own messages on when they fail."""

import os
import subprocess
import sys
from pathlib import Path

from semgrid_eval.errors import InputError, MissingExtraError


def sumo_home() -> Path:
    """Return the folder of the installed SUMO package.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import sumo
    except ImportError:
        raise MissingExtraError("synthetic", "eclipse-sumo") from None
    return Path(sumo.SUMO_HOME)


def run_binary(name: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's binaries (`netgenerate`, `netconvert`, `sumo`) inside `folder`.

    Raises:
        InputError: it failed; the message is SUMO's own.
        MissingExtraError: SUMO is not installed.
    """
    _run(name, [str(sumo_home() / "bin" / name), *options], folder)


def run_tool(name: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's Python tools (`randomTrips`) inside `folder`; raises what `run_binary` raises."""
    _run(name, [sys.executable, str(sumo_home() / "tools" / f"{name}.py"), *options], folder)


def _run(name: str, command: list[str], folder: Path) -> None:
    environment = {**os.environ, "SUMO_HOME": str(sumo_home())}
    try:
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"SUMO's {name} cannot be started: {error.strerror or error}") from error
    if done.returncode < 0:
        raise InputError(f"SUMO's {name} was killed by signal {-done.returncode} (out of memory?)")
    if done.returncode > 0:
        raise InputError(f"SUMO's {name} failed with exit code {done.returncode}: {_fault(done.stderr + done.stdout)}")


def _fault(output: str) -> str:
    """Pick SUMO's own reason: its lines that start with `Error:`, else the last thing that it said."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    faults = [line.removeprefix("Error:").strip() for line in lines if line.startswith("Error:")]
    return "; ".join(faults[:3]) or (lines[-1] if lines else "no message")
