"""Matrices written to files."""

from pathlib import Path
from typing import Any

import yaml

from semgrid_eval.runs.matrix import Matrix, load_matrix


def load(folder: Path, content: str | dict[str, Any]) -> Matrix:
    """Write a matrix and read it."""
    path = folder / "m.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return load_matrix(str(path))


def write(folder: Path, **files: dict[str, Any]) -> None:
    """Write matrices by their names."""
    for name, content in files.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
