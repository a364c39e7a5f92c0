"""Writes docs/formats.md: every key of matrix files, latency profiles and results, from the models that read them.

python tools/format_pages.py [--check]

What a key means is the comment beside or above its field in the code. With --check, nothing is written, and the exit
code is 1 where the page is not what would be.
"""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from semgrid_eval.classes import Category, ClassSet, GridClass
from semgrid_eval.config import Config
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.models.augment import AugmentConfig
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.flow import FlowSettings
from semgrid_eval.models.network import LossConfig, NetworkSettings, OptimizerConfig, ScheduleConfig, TrainingConfig
from semgrid_eval.models.overlay import OverlaySettings
from semgrid_eval.models.recorded import RecordedSettings
from semgrid_eval.models.residual import ResidualSettings
from semgrid_eval.models.votes import DrawSettings
from semgrid_eval.runs.matrix import _MatrixFile
from semgrid_eval.runs.row import Row
from semgrid_eval.scores.facts import RowFacts, StreamFacts, StreamRecord
from semgrid_eval.scores.results import LogRecord, ResultRecord, RowRecord, RunRecord, WindowRecord
from semgrid_eval.sensors.kinds import KINDS
from semgrid_eval.sensors.lidar import ColourFrom
from semgrid_eval.sensors.sensor import SensorConfig
from semgrid_eval.streams.config import StreamConfig
from semgrid_eval.streams.profile import LatencyProfile, MadeBy
from semgrid_eval.windows.disturb.disturbance import Disturbance
from semgrid_eval.windows.disturb.kinds import KINDS as DISTURBANCES
from semgrid_eval.windows.plan import WindowConfig

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "formats.md"
MATRIX: tuple[tuple[str, type[Config]], ...] = (
    ("A matrix file", _MatrixFile),
    ("A row, and `defaults`", Row),
    ("`window`", WindowConfig),
    ("`grid`", GridConfig),
    ("`grid.spec`", GridSpec),
    ("`grid.classes`", ClassSet),
    ("`grid.classes.categories`", Category),
    ("`grid.classes.classes`", GridClass),
    ("`grid.sensors`: every kind", SensorConfig),
    *((f"`grid.sensors`: kind `{name}`", kind.config) for name, kind in KINDS.items()),
    ("`colour_from` of a `lidar`", ColourFrom),
    ("`stream`", StreamConfig),
    ("`disturb`: every kind", Disturbance),
    *((f"`disturb`: kind `{name}`", kind) for name, kind in DISTURBANCES.items()),
    ("`settings` of all networks", NetworkSettings),
    ("`settings` of `ed`", EncoderDecoderSettings),
    ("`settings` of `residual`", ResidualSettings),
    ("`settings` of `overlay`", OverlaySettings),
    ("`settings` of `flow`", FlowSettings),
    ("`settings` of `ceiling` and `fresh`", DrawSettings),
    ("`settings` of `log`", RecordedSettings),
    ("`training`", TrainingConfig),
    ("`training.optimizer`", OptimizerConfig),
    ("`training.schedule`", ScheduleConfig),
    ("`training.loss`", LossConfig),
    ("`training.augment`", AugmentConfig),
)
RESULTS = (
    ("`run.json`", RunRecord),
    ("... `rows`", RowRecord),
    ("... `logs`", LogRecord),
    ("`results/ID/result.json`", ResultRecord),
    ("... `facts`", RowFacts),
    ("... `facts.stream`", StreamFacts),
    ("... `stream`", StreamRecord),
    ("... `windows`", WindowRecord),
)
PROFILE = (("A profile", LatencyProfile), ("`made_by`", MadeBy))
HEAD = """# Formats

*Made by `python tools/format_pages.py` from the code that reads these files. Keys that are not listed are errors; so
are values outside of the limits.*

"""
POLICY = """## When a format changes

- **Logs** say the version of their format (record `recording`). A version that this package does not know is refused,
  in a line. New channels and new keys do not change it; what would make old numbers wrong does, and then old logs are
  converted again from their source.
- **Results, grids, trainings** are named by digests of all that decides them, their format among it. Results of another
  format are refused by `report` and made again by `run`; nothing is read by guess.
- **Matrices, maps, contracts, profiles** are checked key by key: what is no longer there is an error that names it.
- Versions follow Semantic Versioning, and CHANGELOG.md says what is made again.

"""
LOGS = """## Logs

Logs are MCAP files with Protobuf messages, of Foxglove's types where there is one and of `schemas/` else. `{camera}`
is a camera's name, `{lidar}` a LiDAR's.

| topic | type | what it holds |
|---|---|---|
| `/camera/{camera}/image` | `foxglove.CompressedImage` | colour image, PNG or JPEG; scores never read it |
| `/camera/{camera}/disparity` | `foxglove.CompressedImage` | 16 bit PNG, (p - 1) / 256 px, 0 invalid; may be absent |
| `/camera/{camera}/label` | `foxglove.CompressedImage` | 8 bit PNG of Cityscapes label ids |
| `/camera/{camera}/calibration` | `foxglove.CameraCalibration` | pinhole parameters of the rectified image |
| `/camera/{camera}/stereo` | `semgrid.v1.StereoCalibration` | baseline (0: no disparity), place and angles |
| `/ego/motion` | `semgrid.v1.EgoMotion` | speed and yaw rate as reported |
| `/ego/pose` | `foxglove.PoseInFrame` | integrated from these, to look at |
| `/tf` | `foxglove.FrameTransform` | `odom` to `base_link` (ISO 8855), and to each camera |
| `/lidar/{lidar}/points` | `foxglove.PointCloud` | points with labels ([fields](lidar.md#what-a-log-holds)) |
| `/truth/...`, `/camera/{camera}/truth/...` | | on simulated logs: exact labels, disparity, instances, pose, actors |
| `/truth/pose`, `/truth/actors` | | also on logs of others, where annotators tell them |

Recordings are the log's metadata `recording`. What a log has to hold is also `check --print-spec` ([check](check.md)).

"""


def section(title: str, parts: tuple[tuple[str, type[Config]], ...], words: str) -> Iterator[str]:
    """Write the tables of some models below one heading."""
    yield f"## {title}\n\n{words}\n\n"
    for name, model in parts:
        summary = (inspect.getdoc(model) or "").split("\n\n")[0].replace("\n", " ")
        yield f"### {name}\n\n{summary}\n\n"
        rows = list(keys(model))
        if rows:
            yield "| key | type | default | what it is |\n|---|---|---|---|\n" + "".join(rows) + "\n"


def keys(model: type[Config]) -> Iterator[str]:
    """Describe the fields that a model itself declares, a line of a table each."""
    source = textwrap.dedent(inspect.getsource(model))
    lines, body = source.splitlines(), ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    for node in body.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        found = model.model_fields.get(node.target.id)
        if found is not None:
            cells = (f"`{node.target.id}`", _type(node.annotation, found) + _limits(found), _default(found))
            yield "| " + " | ".join(_escaped(cell) for cell in (*cells, _comment(lines, node))) + " |\n"


class _Bare(ast.NodeTransformer):
    """Takes the notes off types."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Put the type in the place of `Annotated[type, ...]`."""
        self.generic_visit(node)
        if ast.unparse(node.value) == "Annotated" and isinstance(node.slice, ast.Tuple):
            return node.slice.elts[0]
        return node


def _type(annotation: ast.expr, field: FieldInfo) -> str:
    if get_origin(field.annotation) is Literal:
        return ", ".join(f"`{choice}`" for choice in get_args(field.annotation))
    return f"`{ast.unparse(_Bare().visit(annotation))}`"


def _limits(field: FieldInfo) -> str:
    signs = {
        Ge: "at least",
        Gt: "above",
        Le: "at most",
        Lt: "below",
        MinLen: "length at least",
        MaxLen: "length at most",
    }
    found = []
    for limit in field.metadata:
        if (words := signs.get(type(limit))) is not None:
            (value,) = vars(limit).values() if hasattr(limit, "__dict__") else (getattr(limit, limit.__slots__[0]),)
            found.append(f"{words} {value}")
    return f", {', '.join(found)}" if found else ""


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value: Any = field.default
    if value is PydanticUndefined:
        return "none" if field.default_factory in (dict, list) else "see text"
    if isinstance(value, Config):
        return "as below"
    if isinstance(value, bool):
        return str(value).lower()
    return "none" if value in (None, ()) else "empty" if value == "" else f"{value}"


def _comment(lines: list[str], node: ast.AnnAssign) -> str:
    """Return the comment beside a field's last line, or those in the lines above it."""
    last = lines[(node.end_lineno or node.lineno) - 1]
    beside = last[node.end_col_offset or 0 :].strip()
    if beside.startswith("#"):
        return beside.removeprefix("#").strip()
    above = []
    for line in reversed(lines[: node.lineno - 1]):
        if not line.strip().startswith("#"):
            break
        above.append(line.strip().removeprefix("#").strip())
    return " ".join(reversed(above))


def _escaped(cell: str) -> str:
    return cell.replace("|", "\\|")


def page() -> str:
    """Write the page."""
    matrix = "What `run` takes: YAML, or JSON. `axes` make several rows of one; [an example](matrix.md)."
    results = "Every file carries a digest of its bytes; what is damaged is made again by `run`."
    profile = "What `latency` writes, or you by hand ([an example](latency.md))."
    parts = (
        section("Matrix files", MATRIX, matrix),
        section("Latency profiles", PROFILE, profile),
        section("Results", RESULTS, results),
    )
    return HEAD + POLICY + LOGS + "".join("".join(part) for part in parts).rstrip() + "\n"


if __name__ == "__main__":
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        sys.exit(f"{PAGE} is not what the code says: python tools/format_pages.py")
