"""How a matrix is run."""

from dataclasses import dataclass, field
from pathlib import Path

from semgrid_eval.executors import Executor, InProcess


@dataclass(frozen=True)
class RunOptions:
    """How a matrix is run; but for the logs to score, nothing here changes its numbers on one machine.

    Args:
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...
        grids: folder in which grids are kept.
        command: how the run was started, for the record.
        only: names or patterns of the rows to work on, all where it is empty; what others have is kept on record.
        executor: where rows are trained and scored.
        grid_executor: where grids are built and pictures made small.
        validation_logs: folder of the logs to score, where they are not among those to train on.
        trainings: folder of the trainings, the run's own if not given; what another run has trained is found there.
        pictures: whether to keep small pictures of the windows' frames for the report.
    """

    device: str
    grids: Path
    command: str
    only: tuple[str, ...] = ()
    executor: Executor = field(default_factory=InProcess)
    grid_executor: Executor = field(default_factory=InProcess)
    pictures: bool = True
    validation_logs: Path | None = None
    trainings: Path | None = None
