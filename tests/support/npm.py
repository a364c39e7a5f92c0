"""Packages from npm, installed beside other files in a folder that is kept between runs."""

import os
import shutil
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest

_QUIET = ("--no-audit", "--no-fund", "--ignore-scripts", "--legacy-peer-deps", "--fetch-retries=0")


def kept(name, packages, files=(), *, timeout_s=60):
    """The folder with packages and copies of files, which its name must tell apart; skips the test without it."""
    folder = Path(tempfile.gettempdir()) / f"semgrid-eval-{name}-{os.getuid()}"
    if not folder.is_dir():
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            fresh = Path(scratch) / "fresh"
            _install(fresh, packages, timeout_s)
            for file in files:
                shutil.copy(file, fresh)
            with suppress(OSError):  # another process of the same suite was faster
                fresh.rename(folder)
    return folder


def _install(folder, packages, timeout_s):
    folder.mkdir()
    try:
        command = ["npm", "install", "--prefix", str(folder), *_QUIET, *packages]
        subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        reason = str(getattr(error, "stderr", None) or error).splitlines()[0]
        pytest.skip(f"npm cannot install {' and '.join(packages)} here: {reason}")
