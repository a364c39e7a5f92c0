"""Reads logs with the reference implementation for JavaScript, which knows nothing of this package."""

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest

PACKAGES = ("@mcap/core@2.2.2", "@mcap/support@1.1.0")
SCRIPT = Path(__file__).parents[1] / "log" / "independent_reader" / "read.mjs"


def reader_script():
    """The script beside its installed packages, kept between runs; skips the test where they cannot be had."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are needed to read a log with the reference implementation for JavaScript")
    version = hashlib.sha256(" ".join(PACKAGES).encode() + SCRIPT.read_bytes()).hexdigest()[:12]
    folder = Path(tempfile.gettempdir()) / f"semgrid-eval-reader-{os.getuid()}-{version}"
    if not folder.is_dir():
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            fresh = Path(scratch) / "reader"
            install(fresh)
            with suppress(OSError):  # another process of the same suite was faster
                fresh.rename(folder)
    return folder / SCRIPT.name


def install(folder):
    folder.mkdir()
    shutil.copy(SCRIPT, folder)
    quiet = ("--no-audit", "--no-fund", "--ignore-scripts", "--fetch-retries=0")
    try:
        command = ["npm", "install", "--prefix", str(folder), *quiet, *PACKAGES]
        subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    except subprocess.SubprocessError as error:
        reason = str(getattr(error, "stderr", None) or error).splitlines()[0]
        pytest.skip(f"npm cannot install {' and '.join(PACKAGES)} here: {reason}")


def read(script, path):
    done = subprocess.run(["node", str(script), str(path)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def of_topic(found, topic):
    return [message for message in found["messages"] if message["topic"] == topic]
