"""Bad class sets: files that a matrix names."""

from pathlib import Path

from support.bad.case import Bad, Kind, lines
from support.bad.matrices import RUN, row_text
from support.bad.matrices import whole as logs

FILE = "classes.yaml"
_CATEGORIES = "categories: [{name: ground}, {name: traffic, moves: fast}]\n"
_UNKNOWN = "{name: unknown, colour: [0, 0, 0]}"
_ROAD = "{name: way, category: ground, colour: [90, 90, 90], labels: [road]}"
_CAR = "{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [car]}"

CLASSES = r"""
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [carr]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [256]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [2.5]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: car}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [car, road]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [car, 26]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: []}
{name: vehicle, category: traffic, colour: [0, 0, 200]}
{name: vehicle, colour: [0, 0, 200], labels: [car]}
{name: vehicle, category: traffik, colour: [0, 0, 200], labels: [car]}
{name: vehicle, category: traffic, colour: [0, 0, 256], labels: [car]}
{name: vehicle, category: traffic, colour: [0, 0], labels: [car]}
{name: vehicle, category: traffic, colour: "#0000c8", labels: [car]}
{name: vehicle, category: traffic, labels: [car]}
{name: vehicle, category: traffic, colour: [0, 0, 200], safe_colour: blue, labels: [car]}
{name: way, category: traffic, colour: [0, 0, 200], labels: [car]}
{name: traffic, category: traffic, colour: [0, 0, 200], labels: [car]}
{name: mean_known, category: traffic, colour: [0, 0, 200], labels: [car]}
{name: Vehicle, category: traffic, colour: [0, 0, 200], labels: [car]}
{name: vehicle, category: traffic, colour: [0, 0, 200], labels: [car], priority: 0}
{name: vehicle, category: traffic, colour: [0, 0, 200], lables: [car]}
"""
_MANY = ", ".join(f"{{name: c{i}, category: ground, colour: [0, 0, 0], labels: [{100 + i}]}}" for i in range(64))


def _classes(*entries: str) -> str:
    return f"{_CATEGORIES}classes: [{', '.join(entries)}]\n"


def _of_ground(keys: str) -> str:
    return f"categories: [{{name: ground, {keys}}}]\nclasses: [{_UNKNOWN}, {_ROAD}]\n"


FILES = {
    "a set without classes": _CATEGORIES,
    "an empty file": "",
    "a set of `unknown` alone": _classes(_UNKNOWN),
    "a set of 65 classes": _classes(_UNKNOWN, _MANY),
    "a set that does not begin with `unknown`": _classes(_ROAD, _CAR),
    "`unknown` with labels": _classes("{name: unknown, colour: [0, 0, 0], labels: [sky]}", _ROAD, _CAR),
    "`unknown` with a priority": _classes("{name: unknown, colour: [0, 0, 0], priority: 9}", _ROAD, _CAR),
    "a category without classes": _classes(_UNKNOWN, _ROAD),
    "a category twice": f"categories: [{{name: ground}}, {{name: ground}}]\nclasses: [{_UNKNOWN}, {_ROAD}]\n",
    "a category that is also a figure": f"categories: [{{name: mean_known}}]\nclasses: [{_UNKNOWN}, {_ROAD}]\n",
    "a category that moves as it likes": _of_ground("moves: often"),
    "kernels of three sides": _of_ground("kernels_cells: [3, 2, 4]"),
    "a kernel of 17 cells": _of_ground("kernels_cells: [17, 2, 4, 4]"),
}
MATRICES = {
    "a file that is not there": row_text("model: newest, grid: {classes: nowhere.yaml}"),
    "a folder in its place": row_text("model: newest, grid: {classes: logs}"),
    "a number in its place": row_text("model: newest, grid: {classes: 10}"),
    "a file named in `defaults` that is not there": b"defaults: {grid: {classes: nowhere.yaml}}\n"
    b"rows: [{name: a, model: newest}]\n",
    "two sets in one matrix": b"rows:\n- {name: a, model: newest}\n"
    b"- {name: b, model: newest, grid: {classes: classes.yaml}}\n",
    "`residual-town` with classes that it does not know": row_text(
        "model: residual-town, grid: {classes: classes.yaml}"
    ),
    "`class_map` to a class of another set": row_text(
        "model: newest, grid: {classes: classes.yaml, class_map: {truck: car}}"
    ),
    "`settings.shift` of `residual`, where nothing moves": row_text(
        "model: residual, settings: {shift: 2}, grid: {classes: still.yaml}"
    ),
    "`residual-flow`, where nothing moves": row_text("model: residual-flow, grid: {classes: still.yaml}"),
}


def whole() -> None:
    """Write a matrix that names a class set, and such a set."""
    logs()
    Path("bad.yaml").write_bytes(row_text(f"model: newest, grid: {{classes: {FILE}}}"))
    Path(FILE).write_text(_classes(_UNKNOWN, _ROAD, _CAR))
    Path("still.yaml").write_text(f"categories: [{{name: ground}}]\nclasses: [{_UNKNOWN}, {_ROAD}]\n")


KIND = Kind(
    "Class sets",
    "Here a matrix `bad.yaml` whose row names a set `classes.yaml`; a class stands after `unknown` and `way`.",
    whole,
    (
        *(Bad(f"`{text}`", RUN, {FILE: _classes(_UNKNOWN, _ROAD, text).encode()}) for text in lines(CLASSES)),
        *(Bad(words, RUN, {FILE: text.encode()}) for words, text in FILES.items()),
        *(Bad(words, RUN, {"bad.yaml": content}) for words, content in MATRICES.items()),
    ),
)
