"""Writes docs/formats.md: channels of logs, every key of matrix files, latency profiles and results, from the code.

python tools/format_pages.py [--check]

What a key means is the comment beside or above its field in the code. With --check, nothing is written, and the exit
code is 1 where the page is not what would be.
"""

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from semgrid_eval.classes import Category, ClassSet, GridClass
from semgrid_eval.config import Config
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log import recovered, topics
from semgrid_eval.log.codec import CONDITIONS_RECORD, PLAYBACK_RECORD, PREDICTIONS_RECORD, RECORD
from semgrid_eval.log.schemas.actors_pb2 import Actors
from semgrid_eval.log.schemas.egomotion_pb2 import Egomotion
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid
from semgrid_eval.log.schemas.stereo_calibration_pb2 import StereoCalibration
from semgrid_eval.log.topics import camera_topic, lidar_picture_topic, lidar_topic
from semgrid_eval.models.augment import AugmentConfig
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.flow import FlowSettings
from semgrid_eval.models.network import LossConfig, NetworkSettings, OptimizerConfig, ScheduleConfig, TrainingConfig
from semgrid_eval.models.overlay import OverlaySettings
from semgrid_eval.models.recorded import RecordedSettings
from semgrid_eval.models.residual import ResidualSettings
from semgrid_eval.models.residual_flow import HintSettings, ResidualFlowSettings
from semgrid_eval.models.votes import DrawSettings
from semgrid_eval.runs.matrix import _MatrixFile
from semgrid_eval.runs.row import Row
from semgrid_eval.scores import results as result_files
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
    ("`settings` of `residual-flow`, beside those of `residual`", ResidualFlowSettings),
    ("... `flow`, beside those of `flow`", HintSettings),
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

- **Logs** say the version of their format (record `semgrid.scene`). A version that this package does not know is
  refused, in a line. New channels and new keys do not change it; what would make old numbers wrong does, and then old
  logs are converted again from their source.
- **Results, grids, trainings** are named by digests of all that decides them, their format among it. Results of another
  format are refused by `report` and made again by `run`; nothing is read by guess.
- **Matrices, maps, contracts, profiles** are checked key by key: what is no longer there is an error that names it.
- Versions follow Semantic Versioning, and CHANGELOG.md says what is made again.

"""
CAMERA, LIDAR = "{camera}", "{lidar}"
CHANNELS: tuple[tuple[str, type[Message], str], ...] = (
    (camera_topic(CAMERA, topics.IMAGE), CompressedImage, "colour image, PNG or JPEG; scores never read it"),
    (
        camera_topic(CAMERA, topics.DISPARITY),
        CompressedImage,
        "16 bit PNG, (p - 1) / 256 px, 0 invalid; may be absent",
    ),
    (camera_topic(CAMERA, topics.LABEL), CompressedImage, "8 bit PNG of Cityscapes label ids"),
    (camera_topic(CAMERA, topics.CALIBRATION), CameraCalibration, "pinhole parameters of the rectified image"),
    (camera_topic(CAMERA, topics.STEREO), StereoCalibration, "baseline (0: no disparity), place and angles"),
    (topics.EGO_MOTION, Egomotion, "speed and yaw rate as reported"),
    (topics.EGO_POSE, PoseInFrame, "integrated from these, to look at"),
    (topics.TRANSFORMS, FrameTransforms, "`odom` to `base_link` (ISO 8855), and to each camera"),
    (lidar_topic(LIDAR), PointCloud, "points with labels ([fields](lidar.md#what-a-log-holds))"),
    (camera_topic(CAMERA, topics.EXACT_LABEL), CompressedImage, "simulated: labels without errors"),
    (camera_topic(CAMERA, topics.EXACT_DISPARITY), CompressedImage, "simulated: disparity without errors"),
    (camera_topic(CAMERA, topics.INSTANCE), CompressedImage, "simulated: 16 bit PNG of actor ids, 0 is no actor"),
    (topics.TRUE_POSE, PoseInFrame, "where the vehicle is; also where a source's annotators tell it"),
    (topics.TRUE_ACTORS, Actors, "boxes of road users; also where a source's annotators tell them"),
)
PLAYED: tuple[tuple[str, type[Message], str], ...] = (
    (topics.GRID_TARGET, Grid, "the target of each time"),
    (f"{topics.GRID_MASK}/{{n}}", Grid, "mask M of row n: seen by an input, unknown in the target"),
    (f"{topics.GRID_PREDICTION}/{{n}}", Grid, "what row n predicts"),
    (f"{topics.GRID_CERTAINTY}/{{n}}", Grid, "how sure it is, where it says"),
    (f"{topics.GRID_INPUT}/{{n}}/{{sensor}}", Grid, "its newest input of each sensor, moved to the target's time"),
    (f"{topics.GRID_INPUT}/{{n}}/{{sensor}}/before_{{i}}", Grid, "inputs before that"),
    (".../exact", SemanticGrid, "beside each grid but certainty: the class ids as they are scored"),
    (".../picture", CompressedImage, "beside each grid but masks and older inputs: it as a picture"),
    (f"{topics.GRID_PREDICTION}/{{n}}/name", SceneUpdate, "name and description of row n"),
    (topics.GRID_LEGEND, CompressedImage, "colours and names of the classes"),
    (lidar_picture_topic(LIDAR), CompressedImage, "what a LiDAR saw all around, as a picture"),
)
RECORDS = (
    (RECORD, "all logs: `format_version`, `name`, `dataset`, `split`, `cameras`, `class_names`, `group`, `digest`"),
    (CONDITIONS_RECORD, "under which errors a log was simulated, each as `0.31 px`"),
    (recovered.RECORD, "of a log that `check --recover` wrote: what was lost"),
    (PREDICTIONS_RECORD, "[predictions made elsewhere](predictions.md): `recording`, whose they are"),
    (PLAYBACK_RECORD, "a played run: `run`, `rows`, `layout`, `shift_ns`; it is no recording"),
)


def logs() -> Iterator[str]:
    """Write what logs hold: channels, the fields of messages of our own, records of metadata."""
    yield (
        "## Logs\n\nLogs are MCAP files with Protobuf messages, of Foxglove's types where there is one and of "
        "`schemas/` else. `{camera}`\nis a camera's name, `{lidar}` a LiDAR's. What a log has to hold is also "
        "`check --print-spec` ([check](check.md)).\n\n"
    )
    yield channels(CHANNELS)
    yield "A [played](playback.md) run has labels and images of these, and\n\n" + channels(PLAYED)
    yield "Metadata records:\n\n| record | what it holds |\n|---|---|\n"
    yield "".join(f"| `{name}` | {words} |\n" for name, words in RECORDS) + "\n"
    for path in sorted((ROOT / "schemas").glob("*.proto")):
        yield from messages(path.read_text(encoding="utf-8"))


def channels(listed: tuple[tuple[str, type[Message], str], ...]) -> str:
    """Write a table of topics."""
    lines = [f"| `{topic}` | `{kind.DESCRIPTOR.full_name}` | {words} |\n" for topic, kind, words in listed]
    return "| topic | type | what it holds |\n|---|---|---|\n" + "".join(lines) + "\n"


def messages(proto: str) -> Iterator[str]:
    """Write a table of fields for each message of a schema; comments stand above what they are of."""
    package = re.findall(r"^package (.+);$", proto, re.MULTILINE)[0]
    comment: list[str] = []
    for line in map(str.strip, proto.splitlines()):
        if line.startswith("//"):
            comment.append(line.removeprefix("//").strip())
            continue
        words, comment = " ".join(filter(None, comment)), []
        if begins := re.match(r"message (\w+)", line):
            yield f"### `{package}.{begins[1]}`\n\n{words}\n\n| field | type | what it is |\n|---|---|---|\n"
        elif field := re.match(r"(.+) (\w+) = \d+;", line):
            yield f"| `{field[2]}` | `{field[1]}` | {words} |\n"
        elif line == "}":
            yield "\n"


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
    """Write `str | None` as `str or None`: a bar ends a cell, and what escapes it is shown by some readers."""
    return cell.replace(" | ", " or ")


def page() -> str:
    """Write the page."""
    matrix = "What `run` takes: YAML, or JSON. `axes` make several rows of one; [an example](matrix.md)."
    files = "```" + (inspect.getdoc(result_files) or "").split("```")[1] + "```"
    results = f"Every file carries a digest of its bytes; what is damaged is made again by `run`.\n\n{files}"
    profile = "What `latency` writes, or you by hand ([an example](latency.md))."
    parts = (
        section("Matrix files", MATRIX, matrix),
        section("Latency profiles", PROFILE, profile),
        section("Results", RESULTS, results),
    )
    return HEAD + POLICY + "".join("".join(part) for part in (logs(), *parts)).rstrip() + "\n"


if __name__ == "__main__":
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        sys.exit(f"{PAGE} is not what the code says: python tools/format_pages.py")
