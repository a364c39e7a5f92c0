from pathlib import Path

import pytest
from support.fake_run import make_fake_run

from semgrid_eval.report.page import write_report


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Path:
    """A finished run with failed rows, read only."""
    return make_fake_run(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture(scope="session")
def page(run, tmp_path_factory) -> Path:
    return write_report(run, tmp_path_factory.mktemp("reports") / "report")
