"""The page that says which line each bad input gets."""

import re
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

from support.bad.case import Bad, Kind

PAGE = Path(__file__).parents[3] / "docs" / "bad-inputs.md"
_LONG_LIST = re.compile(r"((?:[\w./-]+, ){2})(?:[\w./:-]+, ){2,}[\w./:-]+")
_HEAD = """# Bad inputs, and the line that each gets

Whatever is wrong with what you give, the command ends with one line that names file, field and value, an exit code
that is not 0, and nothing half-written. This page holds {count} bad inputs with their lines. The test suite makes each
of them from good files, runs the command and compares (`tests/bad_inputs`); the page is written by

```sh
PYTHONPATH=.:tests python tools/bad_inputs.py
```

`Error: ` before each line is left out, as is `Usage: ...` where the command line itself is at fault. `...` stands for
the rest of a long list, `(digest)` for 16 hexadecimal digits, `(gone)` for a field that is left out. Where a row of a
matrix or a recording is at fault the others go on, and the exit code is 1. `check` prints a line for each finding; the
first error is shown. Some lines quote Python or a library: these are of {versions}; with others, the suite compares
all but the words.
"""


def page_text(lines: Mapping[tuple[str, str], str], kinds: tuple[Kind, ...]) -> str:
    """Write the page; `lines` are by kind and words."""
    return "\n".join([_HEAD.format(count=len(lines), versions=versions()), *_sections(lines, kinds)])


def versions() -> str:
    """Say which versions of what is quoted are installed here."""
    quoted = (f"{name} {version(name)}" for name in ("click", "onnxruntime", "PyYAML", "pydantic", "rosbags"))
    return f"Python {sys.version_info[0]}.{sys.version_info[1]}, {', '.join(quoted)}"


def _sections(lines: Mapping[tuple[str, str], str], kinds: tuple[Kind, ...]) -> Iterator[str]:
    for kind in kinds:
        yield f"## {kind.title}\n\n{kind.about}\n\n| bad input | line |\n|---|---|"
        yield from (row(kind, bad, lines[kind.title, bad.words]) for bad in kind.inputs)
        yield ""


def row(kind: Kind, bad: Bad, line: str) -> str:
    """Write the row of a bad input."""
    return f"{_begin(kind, bad)}{_code(short(line))} |"


def short(line: str) -> str:
    """Leave out the rest of long lists."""
    return _LONG_LIST.sub(r"\1...", line)


def row_of(page: str, kind: Kind, bad: Bad) -> str:
    """Find the row of a bad input on the page."""
    section = page.partition(f"## {kind.title}\n")[2].partition("\n## ")[0]
    found = [each for each in section.splitlines() if each.startswith(_begin(kind, bad))]
    return found[0] if found else "(it is not on the page)"


def _begin(kind: Kind, bad: Bad) -> str:
    return f"| {_code(bad.words) if kind.shows_code else bad.words} | "


def _code(text: str) -> str:
    shown = f"`` {text} ``" if "`" in text else f"`{text}`"
    return shown.replace("|", "\\|")
