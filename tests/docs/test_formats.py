"""The page on formats is what the code says, and says something of every key."""

import runpy

from support.pages import ROOT, text_of

from semgrid_eval.models.registry import MODELS, find_model


def test_the_page_is_what_would_be_made():
    made = runpy.run_path(str(ROOT / "tools" / "format_pages.py"))
    assert text_of("docs/formats.md") == made["page"](), "python tools/format_pages.py"


def test_every_key_of_a_matrix_has_a_line():
    made = runpy.run_path(str(ROOT / "tools" / "format_pages.py"))
    listed = [model for _, model in made["MATRIX"]]
    text = "".join(line for model in listed for line in made["keys"](model))
    models = {kind.Settings for kind in map(find_model, MODELS) if kind.Settings.model_fields}
    assert models <= {*listed, *(base for model in listed for base in model.__mro__)}
    for model in (*listed, *models):
        for key in model.model_fields:
            assert f"| `{key}` |" in text, (model, key)
