"""Reads logs with the reference implementation for JavaScript, which knows nothing of this package."""

import hashlib
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from support.npm import kept

PACKAGES = ("@mcap/core@2.2.2", "@mcap/support@1.1.0")
SCRIPT = Path(__file__).parents[1] / "log" / "independent_reader" / "read.mjs"


def reader_script():
    """The script beside its installed packages, kept between runs; skips the test where they cannot be had."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are needed to read a log with the reference implementation for JavaScript")
    version = hashlib.sha256(" ".join(PACKAGES).encode() + SCRIPT.read_bytes()).hexdigest()[:12]
    return kept(f"reader-{version}", PACKAGES, [SCRIPT]) / SCRIPT.name


def read(script, path):
    done = subprocess.run(["node", str(script), str(path)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def of_topic(found, topic):
    return [message for message in found["messages"] if message["topic"] == topic]
