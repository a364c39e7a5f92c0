"""The page on formats is what the code says, and says something of every key."""

import runpy

from support.pages import ROOT, text_of


def test_the_page_is_what_would_be_made():
    made = runpy.run_path(str(ROOT / "tools" / "format_pages.py"))
    assert text_of("docs/formats.md") == made["page"](), "python tools/format_pages.py"
