"""The notebook runs from its first cell to its last."""

import json

import matplotlib
import matplotlib.pyplot as plt
import pytest
from support.pages import text_of

SMALLER = (
    "recordings=9",
    "recordings=2, width=256, height=128, town_size_m=250, duration_s=15",
)


@pytest.mark.slow
def test_the_notebook_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("agg")
    cells = [cell for cell in json.loads(text_of("docs/first-number.ipynb"))["cells"] if cell["cell_type"] == "code"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells), "kept without outputs"
    shown = {"__name__": "__main__"}
    for cell in cells:
        source = "".join(cell["source"]).replace(*SMALLER)
        exec(compile(source, "notebook", "exec"), shown)
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said[-2:]] == ["overlay", "network"]
    assert all(0 < float(line.split()[1]) < 1 for line in said[-2:])
    assert len(plt.get_fignums()) == 2
    plt.close("all")
