"""`semgrid-eval segment`: label images for logs, by a segmentation network."""

from pathlib import Path
from typing import Any

import click

from semgrid_eval.cli.console import loudness_options, progress
from semgrid_eval.cli.converted import show
from semgrid_eval.cli.fields import parameters_of
from semgrid_eval.cli.options import FILE_THERE, FOLDER, WORKERS, device_option, logs_argument
from semgrid_eval.config import parse_config
from semgrid_eval.segmentation.config import SegmentationConfig

_SHARED = "Logs at once; they share the cores, all of which one log can use."


@click.command(
    "segment",
    params=[
        logs_argument(),
        click.Option(["--model"], required=True, type=FILE_THERE, help="The ONNX file."),
        click.Option(["--out"], required=True, type=FOLDER, help="Folder of the new logs."),
        *parameters_of(SegmentationConfig),
        click.Option(["--workers"], type=WORKERS, default=1, show_default=True, help=_SHARED),
    ],
    epilog="Example: semgrid-eval segment logs --model network.onnx --out labelled",
)
@device_option
@loudness_options
def command(
    logs: tuple[Path, ...],
    model: Path,
    out: Path,
    workers: int,
    device: str,
    **options: Any,  # noqa: ANN401
) -> int:
    """Write logs again as OUT/<split>/<name>.mcap, with label images from a network that sees their colour images.

    LOG is a log or a folder of logs. The network gets one RGB image, float (1, 3, H, W) or (1, H, W, 3), normalised by
    --mean and --std, and gives scores (1, C, h, w), which are scaled to the image's size before the highest is taken,
    or ids (1, h, w). --classes says what becomes of its classes. It runs on a GPU where ONNX Runtime has one (package
    onnxruntime-gpu), else on the CPU; logs note which. Everything else in the logs is kept as it is. Logs whose input,
    model, options and device have not changed are left as they are; one that fails is named, and the exit code is then
    1.
    """
    from semgrid_eval.log.convert import Work
    from semgrid_eval.segmentation.relabel import segment_logs

    config, work = parse_config(SegmentationConfig, options), Work(workers, stage=progress)
    return show(segment_logs(logs, model, config, out, work, device=device), out)
