"""Prints the requirements of pyproject.toml at their lower bounds, one a line, or as they stand, without torch.

python tools/lowest_bounds.py [--usual] [--without NAME ...] EXTRA ...
"""

import argparse
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def requirements(extras: list[str], without: list[str]) -> Iterator[str]:
    """Return the requirements of the package and of some extras, each once, but for those that are left out."""
    project = tomllib.loads(PROJECT.read_text())["project"]
    listed = [*project["dependencies"], *(each for extra in extras for each in project["optional-dependencies"][extra])]
    for requirement in dict.fromkeys(listed):
        if re.split(r"[<>=]", requirement)[0] not in without:
            yield requirement


def at_its_lowest(requirement: str) -> str:
    """Turn `name>=1.2,<3` into `name==1.2`."""
    return re.sub(r">=([^,]+).*", r"==\1", requirement)


def main() -> None:
    """Print them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("extras", nargs="*")
    parser.add_argument("--usual", action="store_true", help="as they stand, not at their lower bounds")
    parser.add_argument("--without", action="append", default=["torch"])
    options = parser.parse_args()
    for requirement in requirements(options.extras, options.without):
        print(requirement if options.usual else at_its_lowest(requirement))  # noqa: T201 - a tool's output


if __name__ == "__main__":
    main()
