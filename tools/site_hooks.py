"""What `make docs` changes in pages for the site."""

import re

import semgrid_eval

_REFERENCE = "::: semgrid_eval\n"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Show what lies in the repository, and not on the site, by its path; put every public name in the reference."""
    names = (f"::: {place}.{name}\n" for name, place in sorted(semgrid_eval._PLACES.items()) if name[0].islower())
    types = (f"::: {place}.{name}\n" for name, place in sorted(semgrid_eval._PLACES.items()) if not name[0].islower())
    markdown = markdown.replace(_REFERENCE, "\n".join((*names, *types)))
    return re.sub(r"\[([^\]]+)\]\(\.\./([^)]+)\)", r"\1 (`\2`)", markdown)
