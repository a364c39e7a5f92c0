"""Bad axes of rows."""

from support.bad.case import Kind, lines, table
from support.bad.matrices import RUN, whole

AXES = r"""
name: a, axes: {zip: {settings.depth: [2, 3], settings.features: [16]}}
name: a, axes: {product: {settings.depth: [2, 3]}}
name: a, axes: {grid: {settings.depth: 3}}
name: "a{settings.dept}", axes: {grid: {settings.depth: [2, 3]}}
name: a, axes: {grid: {settings.depth: [2, 3]}}
name: "a{settings.dept}", axes: {grid: {settings.dept: [2, 3]}}
name: a, axes: [settings.depth]
name: "a{settings.depth}", axes: {grid: {settings.depth: [[2]]}}
name: "a{settings.depth.x}", axes: {grid: {settings.depth.x: [2]}}
name: "a{settings.}", axes: {grid: {settings.: [2]}}
name: "a{window.inputs}", window: 2, axes: {grid: {window.inputs: [2, 3]}}
name: "a{window.inputs}", axes: {zip: {window: [3], window.inputs: [2]}}
name: "a{grid.classes}", axes: {grid: {grid.classes: [mine.yaml, yours.yaml]}}
name: "a{grid.classes}", axes: {grid: {grid.classes: [3]}}
name: a, axes: {grid: {grid: [{classes: mine.yaml}]}}
"""

_MANY = ", ".join(f"settings.x{each}: [{', '.join(map(str, range(22)))}]" for each in range(3))
BYTES = {line: f"rows: [{{model: ed, {line}}}]\n".encode() for line in lines(AXES)} | {
    "axes that give more than 10,000 rows": f"rows: [{{name: a, model: ed, axes: {{grid: {{{_MANY}}}}}}}]\n".encode()
}

KIND = Kind(
    "Axes of a row",
    "A matrix `bad.yaml` with one row, `model: ed` and what the table says.",
    whole,
    table(RUN, "bad.yaml", BYTES),
    shows_code=True,
)
