"""Evaluate short-term prediction on semantic grids, offline and from recorded MCAP logs."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("semgrid-eval")
except PackageNotFoundError:  # running from a source tree that was never installed
    __version__ = "0.0.0"
