"""Where a run's numbers come from: versions, commit and machine."""

import os
import platform
import subprocess
from functools import cache
from pathlib import Path

import torch

import semgrid_eval
from semgrid_eval.packages import installed_versions

_PACKAGES = (
    "torch",
    "numpy",
    "numba",
    "opencv-python-headless",
    "mcap",
    "protobuf",
    "pandas",
    "eclipse-sumo",
    "embreex",
)


def versions() -> dict[str, str]:
    """Return the version of this package, of Python and of what the numbers depend on; from a checkout, its commit."""
    found = {"semgrid-eval": semgrid_eval.__version__, "python": platform.python_version()}
    if commit := commit_of(Path(semgrid_eval.__file__).parent):
        found["semgrid-eval (commit)"] = commit
    return found | installed_versions(_PACKAGES)


def machine(device: torch.device, threads: int) -> dict[str, str]:
    """Describe the machine, without its name, and the threads of each process that trains."""
    described = {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_cores": str(os.cpu_count()),
        "torch_threads": str(threads),
        "device": str(device),
    }
    if device.type == "cuda":
        described["gpu"] = torch.cuda.get_device_name(device)
    return described


@cache
def commit_of(package: Path) -> str | None:
    """Return the commit of the checkout that a package lies in, marked `-dirty` where files of it were changed.

    None where the package is not tracked, as in a virtual environment inside another project, or where git is absent.
    """
    try:
        _git(package, "ls-files", "--error-unmatch", "__init__.py")
        return _git(package, "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", folder, *arguments], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()
