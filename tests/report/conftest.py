from pathlib import Path

import pytest
from support.browser import chromium
from support.fake_run import HOSTILE, REFERENCE_ROWS, FakeRow, make_fake_run
from support.seen_run import make_seen_run

from semgrid_eval.report.page.write import write_report
from semgrid_eval.scores.results import read_run, result_folder, write_run


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser for the tests of a module."""
    with chromium(tmp_path_factory.mktemp("browser")) as driver:
        yield driver


@pytest.fixture(scope="session")
def reference_page(tmp_path_factory) -> Path:
    """The page of a run of the shape of the reference run."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    run = make_fake_run(folder, rows=REFERENCE_ROWS, recordings=6, windows=1)
    return write_report(run, tmp_path_factory.mktemp("reports") / "reference")


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Path:
    """A finished run with failed rows, read only."""
    return make_fake_run(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture(scope="session")
def page(run, tmp_path_factory) -> Path:
    return write_report(run, tmp_path_factory.mktemp("reports") / "report")


@pytest.fixture(scope="session")
def seen(tmp_path_factory) -> Path:
    """A real run on toy streets that keeps pictures of its logs, read only."""
    return make_seen_run(tmp_path_factory.mktemp("seen"))


@pytest.fixture(scope="session")
def seen_page(seen, tmp_path_factory) -> Path:
    return write_report(seen, tmp_path_factory.mktemp("reports") / "seen")


@pytest.fixture(scope="session")
def side_by_side(tmp_path_factory) -> Path:
    """The page of two runs of the same two rows, `first` and `other`."""
    folder = tmp_path_factory.mktemp("runs")
    runs = [
        make_fake_run(folder / name, rows=(FakeRow("DC", "BL"), FakeRow("DC", "ED", wrong, 1)), windows=1)
        for name, wrong in (("first", 0.06), ("other", 0.3))
    ]
    return write_report(runs, tmp_path_factory.mktemp("reports") / "both")


@pytest.fixture(scope="session")
def troubled(tmp_path_factory) -> Path:
    """The page of a run whose names are as hostile as can be, with a failed row, a damaged result and a failed log."""
    failed = FakeRow("Sp2", "ED", failure="out of memory")
    kinds = (*(FakeRow(e, m, 0.1, int(m == "ED")) for m in ("BL", "ED") for e in ("DC", "NT")), FakeRow("Fuse", "BL"))
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", recordings=2, windows=1, rows=(*kinds, failed))
    record = read_run(run)
    hostile = tuple(
        row.model_copy(update={"name": name, "label": name, "facts": row.facts.model_copy(update={"sensors": (name,)})})
        for row, name in zip(record.rows, HOSTILE, strict=False)
    )
    (result_folder(run, record.rows[4].results[0]) / "sums.npz").write_bytes(b"not a zip")
    rows, broken = (*hostile, *record.rows[4:]), {name: name for name in HOSTILE}
    write_run(run, record.model_copy(update={"title": " ".join(HOSTILE), "rows": rows, "failed_logs": broken}))
    return write_report(run, tmp_path_factory.mktemp("reports") / "troubled")
