"""The simulation behind the page on intervals: lengthened ones miss the truth less often, on either kind of world."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.fake_run import REFERENCE_ROWS, make_fake_run

TOOL = Path(__file__).parents[2] / "tools" / "interval_coverage.py"


def _tables(*arguments):
    done = subprocess.run([sys.executable, TOOL, *arguments], capture_output=True, text=True, check=True)
    return [
        [[float(value) for value in re.findall(r"[\d.]+", line)] for line in table] for table in _lines(done.stdout)
    ]


def _lines(text):
    """The lines of numbers of each table."""
    return [[line for line in part.splitlines() if re.match(r"\| \d", line)] for part in text.split("|---|\n")[1:]]


@pytest.mark.slow
def test_worlds_are_simulated():
    for table in _tables("--trials", "60"):
        assert [line[0] for line in table] == [3, 5, 10, 20, 50, 120]
        (_, below, above, less, more), *_ = table
        assert less + more < below + above


def test_the_recordings_of_a_run_are_a_world(tmp_path):
    run = make_fake_run(tmp_path / "run", rows=REFERENCE_ROWS[:2], recordings=6, windows=1)
    (table,) = _tables("--run", run, "ED-DC", "BL-DC", "mean_known", "--trials", "20")
    assert len(table) == 6
    assert all(less + more <= below + above for _, below, above, less, more in table)
