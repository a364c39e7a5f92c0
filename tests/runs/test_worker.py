"""Workers: windows that seeds and rows share are selected once, and those that differ are not."""

import pytest
from support.toy_world import street

from semgrid_eval.log.store import write_log
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions, make_worker
from semgrid_eval.windows.plan import WindowConfig

SHORT = WindowConfig(step_frames=2, target_frame=8)
ROWS = [
    Row(name=f"{number}", window=SHORT, **choice)
    for number, choice in enumerate(
        [
            {"model": "ed"},
            {"model": "ed", "translate": False},
            {"model": "ed", "sensors": ("split1_upper", "split1_lower")},
            {"model": "ed", "sensors": ("split1_lower", "split1_upper")},
            {"model": "ed", "validation_window": WindowConfig(step_frames=3, target_frame=8)},
            {"model": "ed", "validation_window": WindowConfig(step_frames=2, target_frame=None)},
            {"model": "ed", "train_split": "val"},
            {"model": "ed", "validation_split": "train"},
            {"model": "ed", "grid": {"morphology": "off"}},
            {"model": "table"},
            {"model": "newest"},
        ]
    )
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("worker")
    for i, (logs, split) in enumerate([("town", "train"), ("town", "val"), ("real", "val")]):
        write_log(street(i, frames=9 + i).recording(f"{logs}{i}", split), folder / logs / f"{i}.mcap")
    return folder


def worker(folder, scored):
    options = RunOptions("cpu", folder / "grids", "test", validation_logs=scored and folder / scored)
    return make_worker(
        Matrix(title="t", seed=0, rows=tuple(ROWS)), folder / "town", folder / "run", options, silent_stage
    )


def told(job):
    """All that a job says of its windows."""
    parts = (job.scored, job.training and job.training.windows, job.training and job.training.watched)
    digests = [part and (part.digest(), part.translate, part.sensors) for part in parts]
    return job.result_id, job.windows_id, job.training and job.training.id, digests, job.left_out


@pytest.mark.parametrize("scored", [None, "real"])
def test_rows_are_resolved_as_by_a_worker_of_their_own(folder, scored):
    shared = worker(folder, scored)
    rows = [row for row in ROWS if not (scored and row.validation_split == "train")]  # the real logs have no such split
    for row in [*rows, *reversed(rows)]:
        seed = 0 if row.model == "ed" else None
        assert told(shared.look(row, seed)) == told(worker(folder, scored).look(row, seed))


def test_seeds_share_their_windows(folder):
    one = worker(folder, "real")
    first, second = (one.look(ROWS[0], seed) for seed in (0, 1))
    assert first.training.id != second.training.id
    assert first.scored is second.scored
    assert first.training.windows is second.training.windows
    assert first.training.watched is second.training.watched
    assert first.training.watched is not first.scored
