"""Lists the interpreters from 3.11 to 3.13 that work on this machine, one of each version, but for this one's.

python tools/other_pythons.py
"""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

MINORS = (11, 12, 13)


def candidates(minor: int) -> Iterator[Path]:
    """Return where a version may lie: on the path, or where pyenv keeps it."""
    name = f"python3.{minor}"
    if found := shutil.which(name):
        yield Path(found)
    yield from sorted((Path.home() / ".pyenv" / "versions").glob(f"3.{minor}.*/bin/{name}"))


def works(python: Path, minor: int) -> bool:
    """Tell whether an interpreter runs, is of its version, and can make virtual environments."""
    code = f"import sys, venv, ensurepip; sys.exit(sys.version_info[:2] != (3, {minor}))"
    try:
        return subprocess.run([python, "-c", code], capture_output=True, timeout=60, check=False).returncode == 0
    except (OSError, subprocess.SubprocessError):
        return False


def main() -> None:
    """Print them."""
    for minor in MINORS:
        found = next((each for each in candidates(minor) if works(each, minor)), None)
        if found is not None and minor != sys.version_info.minor:
            print(found)  # noqa: T201 - a tool's output


if __name__ == "__main__":
    main()
