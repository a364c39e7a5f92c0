"""Write docs/bad-inputs.md: run each bad input of `tests/support/bad`, and note the line in which it ends.

Example: PYTHONPATH=.:tests python tools/bad_inputs.py

With --unreached, print instead every place in the package that raises an error which no bad input reaches; what runs in
processes of their own is not seen.
"""

import argparse
import ast
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from support.bad.case import outcome
from support.bad.known import KINDS
from support.bad.page import PAGE, page_text

import semgrid_eval

PACKAGE = Path(semgrid_eval.__file__).parent
Place = tuple[str, int]


def found_lines(trace: Callable[..., Any] | None = None) -> dict[tuple[str, str], str]:
    """Run every bad input, traced if asked for, and return its line by kind and words."""
    lines = {}
    for kind in KINDS:
        for bad in kind.inputs:
            sys.settrace(trace)  # again each time: a trace ends where recursion is too deep for it
            found = outcome(kind, bad)
            sys.settrace(None)
            if found.code == 0 or len(found.errors) != 1:
                raise SystemExit(f"{kind.title}: {bad.words}: not one line, or exit code 0: {found}")
            lines[kind.title, bad.words] = found.errors[0]
        sys.stderr.write(f"{kind.title}: {len(kind.inputs)}\n")
    return lines


def raising_places() -> dict[Place, str]:
    """Find each `raise` in the package that makes an error, by file and line: its first line of code."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                found[str(path), node.lineno] = text.splitlines()[node.lineno - 1].strip()
    return found


def reached_places() -> set[Place]:
    """Run every bad input, and return where in the package errors were raised or passed."""
    found: set[Place] = set()

    def local(frame: FrameType, event: str, _: Any) -> Any:  # noqa: ANN401 - as `sys.settrace` wants it
        if event == "exception":
            found.add((frame.f_code.co_filename, frame.f_lineno))
        return local

    def of_package(frame: FrameType, _event: str, _argument: Any) -> Any:  # noqa: ANN401
        if not frame.f_code.co_filename.startswith(str(PACKAGE)):
            return None
        frame.f_trace_lines = False
        return local

    found_lines(of_package)
    return found


def unreached() -> Iterator[str]:
    """Name each place that raises an error and is not reached."""
    reached = reached_places()
    for (path, line), text in raising_places().items():
        if (path, line) not in reached:
            yield f"{Path(path).relative_to(PACKAGE.parent)}:{line}: {text}"


def main() -> None:
    """Write the page, or print what is not reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--unreached", action="store_true", help="Print where errors are raised that no input reaches.")
    if parser.parse_args().unreached:
        for place in unreached():
            sys.stdout.write(f"{place}\n")
    else:
        PAGE.write_text(page_text(found_lines(), KINDS), encoding="utf-8")


if __name__ == "__main__":
    main()
