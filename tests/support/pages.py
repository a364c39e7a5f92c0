"""The pages that users read, and what they show."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", *DOCS]


def text_of(name):
    """Return a page by its path from the root."""
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(language, page):
    """Return what stands in a page's blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def commands(page):
    """Return the command lines of a page in their order, without comments, continued lines joined."""
    shown = "\n".join(blocks("sh", page)).replace("\\\n", " ")
    lines = (re.split(r"\s+#|^#", line)[0].strip() for line in shown.splitlines())
    return [line for line in lines if line]


def name_of(path):
    """Say which page it is."""
    return path.relative_to(ROOT).as_posix()
