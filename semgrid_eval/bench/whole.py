"""Measures what a user waits for in one piece: the demo, and the report of a large run."""

import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial

from semgrid_eval.bench.large_run import make_run
from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, wall_s

DEMO_AT_MOST_S = 180.0
REPORT_AT_MOST_S, REPORT_AT_MOST_MIB = 60.0, 1024.0
_KIB = 1 if sys.platform == "darwin" else 1024
"""What `ru_maxrss` counts, in bytes."""
_REPORT = (
    "-c",
    "import sys; from pathlib import Path; from semgrid_eval.report.page.write import write_report;"
    "write_report(Path(sys.argv[1]))",  # the command would also name the pictures that a made run lacks
)


def measure_demo(material: Material) -> Iterator[Measurement]:
    """Go from a simulated town to a report once, by the clock, as `make demo` does after its set-up."""
    arguments = ["demo", "--out", str(material.folder / "demo"), "--quiet"]
    run = partial(
        subprocess.run, [sys.executable, "-m", "semgrid_eval", *arguments], check=True, stdout=subprocess.DEVNULL
    )
    yield Measurement("from a simulated town to a report", wall_s(run, 1), "s", DEMO_AT_MOST_S)


def measure_report(material: Material) -> Iterator[Measurement]:
    """Report a large run, every window a recording of its own, in a process apart."""
    rows, repeats, windows = material.settings.reported
    run = material.folder / "large"
    make_run(run, rows, repeats, windows)
    what = f"{rows} rows, {repeats} repeats, {windows} recordings"
    seconds, most_mib = _of_process([*_REPORT, str(run)])
    yield Measurement(what, seconds, "s CPU", REPORT_AT_MOST_S)
    yield Measurement(f"{what}, memory", most_mib, "MiB", REPORT_AT_MOST_MIB)


def _of_process(arguments: list[str]) -> tuple[float, float]:
    """Run Python: its processor time in seconds, and the most memory that it held, in MiB."""
    process = subprocess.Popen([sys.executable, *arguments])
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    return used.ru_utime + used.ru_stime, used.ru_maxrss * _KIB / 2**20
