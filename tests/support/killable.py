"""A run in a process of its own, which a test may kill at any moment."""

from pathlib import Path

import torch

from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix


def run_here(matrix: str, logs: str, out: str) -> None:
    """Run a matrix from beginning to end, with one thread."""
    torch.set_num_threads(1)
    options = RunOptions("cpu", Path(out) / "grids", "test")
    run_matrix(load_matrix(matrix), Path(logs), Path(out), options)
