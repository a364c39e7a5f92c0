"""The floors of the house: a module imports from lower floors only, and some packages live on one floor alone."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import semgrid_eval
from semgrid_eval.models.registry import MODELS

ROOT = Path(semgrid_eval.__file__).parent
FLOORS = [
    "ground",
    "recording",
    "log",
    "segmentation",
    "sources",
    "sensors",
    "grids",
    "windows",
    "models",
    "scores",
    "streams",
    "runs",
    "playback",
    "report",
    "api",
    "bench",
    "cli",
]
ALLOWED_IN = {
    "mcap": {"log", "playback", "bench"},  # whose reader is a rival
    "google": {"log", "playback"},
    "foxglove_schemas_protobuf": {"log", "playback"},
    "onnxruntime": {"segmentation"},
    "torch": {"windows", "models", "scores", "streams", "runs", "api", "bench"},
    "click": {"cli"},
    "rich": {"cli"},
    "ray": {"ground"},
    "jinja2": {"report"},
    "matplotlib": {"report", "api"},
    "sumo": {"sources"},
    "trimesh": {"sources"},
    "rosbags": {"sources"},
    "pyarrow": {"sources"},
}


def modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(ROOT.rglob("*.py")):
        if "_pb2" not in path.name:
            yield floor_of(path.relative_to(ROOT).with_suffix("").parts), path


def floor_of(parts: tuple[str, ...]) -> str:
    if parts == ("__init__",):  # the public names, each imported when it is asked for
        return "api"
    if parts == ("__main__",):
        return "cli"
    return parts[0] if parts and parts[0] in FLOORS else "ground"


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_modules_import_from_lower_floors_only():
    climbs = [
        f"{path.relative_to(ROOT)} imports {name}"
        for floor, path in modules()
        for name in imports(path)
        if name.startswith("semgrid_eval.") and FLOORS.index(floor_of(tuple(name.split(".")[1:]))) > FLOORS.index(floor)
    ]
    assert climbs == []


def test_packages_stay_on_their_floor():
    strays = [
        f"{path.relative_to(ROOT)} imports {name}"
        for floor, path in modules()
        for name in imports(path)
        if floor not in ALLOWED_IN.get(name.split(".")[0], {floor})
    ]
    assert strays == []


def test_report_reads_files_and_needs_neither_torch_nor_runs():
    forbidden = ("torch", "semgrid_eval.runs", "semgrid_eval.models", "semgrid_eval.windows")
    allowed = tuple(
        f"semgrid_eval.scores.{name}"
        for name in ("facts", "results", "sums", "metrics", "regions", "tidy", "thumbnails")
    )
    for floor, path in modules():
        if floor == "report":
            for name in imports(path):
                assert not name.startswith(forbidden), f"{path.name} imports {name}"
                assert not name.startswith("semgrid_eval.scores") or name.startswith(allowed), name


def test_names_of_rows_mean_something_to_the_papers_claims_alone():
    told = [
        f"{path.relative_to(ROOT)}: {word}"
        for path in (*(ROOT / "report").rglob("*.py"), *(ROOT / "report").rglob("*.j2"))
        for word in ("BL-", "ED-", '"BL"', '"ED"', '"DC"', '.partition("-")')
        if "claims" not in path.parts and word in path.read_text()
    ]
    assert told == []


def test_runs_reports_and_commands_name_no_model():
    named = re.compile("|".join(rf"[\"']{name}[\"']" for name in MODELS if name != "log"))  # also an argument
    strays = [
        path for floor, path in modules() if floor in ("runs", "report", "cli") and named.search(path.read_text())
    ]
    assert strays == []


def test_no_module_is_long_and_no_two_import_each_other():
    paths = {name_of(path): path for _, path in modules()}
    assert {name for name, path in paths.items() if path.read_text().count("\n") > 300} == set()
    needs = {name: set(needed_at_once(path)) & paths.keys() for name, path in paths.items()}
    ordered = TopologicalSorter(needs).static_order()  # raises CycleError
    assert len(list(ordered)) == len(paths)


def name_of(path: Path) -> str:
    return ".".join(("semgrid_eval", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")


def needed_at_once(path: Path) -> Iterator[str]:
    """What a module imports when it is imported, each name as a module and as a member of one."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
            yield str(node.module)
