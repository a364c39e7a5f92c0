"""Measures what a user waits for in one piece: the demo, and the report of a large run."""

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from semgrid_eval.bench.large_run import make_run
from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, apart, processor_clock_s, seconds_passed, wall_s
from semgrid_eval.bench.memory import most_memory_mib
from semgrid_eval.report.page.write import write_report

DEMO_AT_MOST_S = 180.0
REPORT_AT_MOST_S, REPORT_AT_MOST_MIB = 60.0, 1024.0


def measure_demo(material: Material) -> Iterator[Measurement]:
    """Go from a simulated town to a report once, by the clock, as `make demo` does after its set-up."""
    arguments = ["demo", "--out", str(material.folder / "demo"), "--quiet"]
    command = [sys.executable, "-m", "semgrid_eval", *arguments]
    run = partial(subprocess.run, command, check=True, stdout=subprocess.DEVNULL)
    yield Measurement("from a simulated town to a report", wall_s(run, 1), "s", DEMO_AT_MOST_S)


def measure_report(material: Material) -> Iterator[Measurement]:
    """Report a large run, every window a recording of its own, in a process apart."""
    rows, repeats, recordings = material.settings.reported
    run = material.folder / "large"
    make_run(run, rows, repeats, recordings)
    passed_s, worked_s, most_mib = apart(partial(_report, run))
    what = f"{rows} rows, {repeats} repeats, {recordings} recordings"
    yield Measurement(f"{what}, by the clock", passed_s, "s", REPORT_AT_MOST_S)
    yield Measurement(what, worked_s, "s CPU")
    yield Measurement(f"{what}, memory", most_mib, "MiB", REPORT_AT_MOST_MIB)


def _report(run: Path) -> tuple[float, float, float]:
    """Return seconds by the clock, seconds of the processor, and the most memory that this process has held, in MiB."""
    began_s, worked_s = seconds_passed(), processor_clock_s()
    write_report(run)
    return seconds_passed() - began_s, processor_clock_s() - worked_s, most_memory_mib()
