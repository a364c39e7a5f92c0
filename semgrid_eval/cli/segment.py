"""`semgrid-eval segment`: label images for logs, by a segmentation network."""

from pathlib import Path
from typing import Any

import click

from semgrid_eval.cli.console import progress
from semgrid_eval.cli.convert import show
from semgrid_eval.config import parse_config
from semgrid_eval.executors import local_executor
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.relabel import segment_logs

_DEFAULTS = SegmentationConfig()


@click.command("segment", epilog="Example: semgrid-eval segment logs --model network.onnx --out labelled")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True))
@click.option(
    "--model", required=True, type=click.Path(path_type=Path, exists=True, dir_okay=False), help="The ONNX file."
)
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the new logs.")
@click.option("--label-ids", is_flag=True, help="Classes are Cityscapes label ids instead of the 19 train ids.")
@click.option("--mean", nargs=3, type=float, default=_DEFAULTS.mean, show_default=True, help="Of RGB in 0..1.")
@click.option("--std", nargs=3, type=float, default=_DEFAULTS.std, show_default=True, help="Of RGB in 0..1.")
@click.option("--size", nargs=2, type=int, metavar="WIDTH HEIGHT", help="For the network.  [default: the image's]")
@click.option(
    "--layout",
    type=click.Choice(["nchw", "nhwc"]),
    default=_DEFAULTS.layout,
    show_default=True,
    help="Order of the axes of image and scores.",
)
@click.option("--output", help="Which output of the model to read, where there are several.")
@click.option(
    "--upsample",
    type=click.Choice(["bilinear", "nearest"]),
    default=_DEFAULTS.upsample,
    show_default=True,
    help="How scores get the image's size.",
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    help="Logs at once; they share the cores, all of which one log can use.",
)
def command(logs: tuple[Path, ...], model: Path, out: Path, workers: int, **options: Any) -> int:  # noqa: ANN401
    """Write logs anew as OUT/<split>/<name>.mcap, with label images that a network gives for their colour images.

    LOG is a log or a folder of logs. The network gets one RGB image, float (1, 3, H, W), normalised by --mean and
    --std, and gives scores (1, C, h, w) or ids (1, h, w), which are brought to the image's size. Everything else in the
    logs is kept as it is. Logs whose log, model and options have not changed are left as they are; one that fails is
    named, and the exit code is then 1.
    """
    config = parse_config(SegmentationConfig, options)
    with progress("segment") as watch:
        summary = segment_logs(logs, model, config, out, executor=local_executor(workers), progress=watch)
    return show(summary, out)
