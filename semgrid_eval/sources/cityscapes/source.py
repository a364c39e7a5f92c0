"""The Cityscapes sequence tree as the command line offers it; light to import."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from semgrid_eval.config import Config
from semgrid_eval.sources.known import Source, later

CAMERA_NAME = "front"
_LABELS = "Folder of label images whose names begin with the frame's, anywhere below it; else gtFine is used."
_HELP = """Convert the Cityscapes sequence tree SRC to logs OUT/<split>/<city>_<sequence>_<first frame>.mcap.

SRC holds leftImg8bit_sequence, disparity_sequence, vehicle_sequence, timestamp_sequence and camera (for each frame
or one of a sequence). Where frame numbers break off inside a stretch of 30 a frame is lost, elsewhere another log
begins.

A recording fails as a whole, named with the file at fault, if a frame is lost, a file is missing, broken or
impossible, camera files differ, time stamps do not grow, or a picture has another size or bit depth: windows count
frames, so none may be dropped. Frames without a label image are allowed. The other recordings are converted; the
exit code is then 1. Logs whose inputs have not changed are left as they are.
"""


class CityscapesOptions(Config):
    """Which recordings of which tree, and how its label images are to be read."""

    src: Path
    labels: Annotated[Path | None, Field(description=_LABELS)] = None
    train_ids: Annotated[bool, Field(description="Label images hold train ids instead of label ids.")] = False
    split: Annotated[tuple[str, ...], Field(description="Only this split; may be given several times.")] = ()
    camera_name: Annotated[str, Field(description="Name of the camera in the logs.")] = CAMERA_NAME


SOURCE = Source(
    options=CityscapesOptions,
    convert=later("semgrid_eval.sources.cityscapes.tree:convert_cityscapes"),
    help=_HELP,
    example="semgrid-eval convert cityscapes cityscapes logs --labels predictions --split val",
)
