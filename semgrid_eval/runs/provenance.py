"""Where a run's numbers come from: versions and machine."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version

import torch

import semgrid_eval

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
    """Return the version of this package, of Python and of what the numbers depend on."""
    found = {"semgrid-eval": semgrid_eval.__version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine(device: torch.device) -> dict[str, str]:
    """Describe the machine, without its name."""
    described = {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_cores": str(os.cpu_count()),
        "torch_threads": str(torch.get_num_threads()),
        "device": str(device),
    }
    if device.type == "cuda":
        described["gpu"] = torch.cuda.get_device_name(device)
    return described
