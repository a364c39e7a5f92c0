"""int8 is tried on networks of a matrix: a table each, and never a window both calibrated on and scored."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.small_runs import TINY, WINDOW, write_logs

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which writes what ONNX Runtime reads, is not installed")

TOOL = Path(__file__).parents[2] / "tools" / "int8.py"
ROWS = [{"name": "ED", "model": "ed"}, {"name": "RN", "model": "residual", "settings": {"widths": [4, 8], "fine": 4}}]


def call(folder, rows, **defaults):
    matrix = folder / "m.yaml"
    training = TINY["ed"]["training"]
    models = TINY | {"residual": {"training": training}}
    matrix.write_text(json.dumps({"models": models, "defaults": {"window": WINDOW, **defaults}, "rows": rows}))
    command = [sys.executable, TOOL, matrix, "--logs", folder / "logs", "--out", folder / "run"]
    return subprocess.run([*command, "--windows", "2", "--calibrated", "2"], capture_output=True, text=True)


@pytest.mark.slow
def test_each_way_is_compared_with_eager_float32(tmp_path):
    write_logs(tmp_path / "logs")
    done = call(tmp_path, ROWS)
    assert done.returncode == 0, done.stderr
    found = re.findall(r"^\| (.+?) \| [\d.]+ \| [\d.]+ \| [\d.]+ \| [\d.]+ \| ([\d.]+)", done.stdout, re.MULTILINE)
    assert [name for name, _ in found] == 2 * [
        "eager float32",
        "the package",
        "ONNX Runtime, float32",
        "ONNX Runtime, int8",
    ]
    equal = [float(percent) for _, percent in found]
    for plain, _, exported, quantised in (equal[:4], equal[4:]):
        assert plain == 100.0
        assert exported > 99.9  # as good as the same sums
        assert 50.0 < quantised <= exported
    assert re.findall(r"^\| (\w+) \| ms", done.stdout, re.MULTILINE) == ["ED", "RN"]


@pytest.mark.slow
def test_what_is_scored_is_not_calibrated_on(tmp_path):
    write_logs(tmp_path / "logs")
    done = call(tmp_path, ROWS[:1], train_split="val")
    assert done.returncode != 0
    assert "a window that is scored is calibrated on" in done.stderr
