"""What `make docs` changes in pages for the site."""

import re

import semgrid_eval

_REFERENCE = "::: semgrid_eval\n"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Show what lies in the repository, and not on the site, by its path; put every public name in the reference."""
    functions_first = sorted(semgrid_eval._PLACES.items(), key=lambda entry: (not entry[0].islower(), entry[0]))
    names = (f"::: {place}.{name}\n" for name, place in functions_first)
    markdown = markdown.replace(_REFERENCE, "\n".join(names))
    return re.sub(r"\[([^\]]+)\]\(\.\./([^)]+)\)", r"\1 (`\2`)", markdown)
