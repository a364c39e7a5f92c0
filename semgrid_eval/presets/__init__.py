"""Experiment matrices that come with the package."""

from importlib import resources


def preset_names() -> list[str]:
    """List them."""
    names = (file.name for file in resources.files(__name__).iterdir())
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))
