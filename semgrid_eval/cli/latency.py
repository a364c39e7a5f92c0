"""`semgrid-eval latency`: how long a perception chain takes on this machine, from pictures to a prediction."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from semgrid_eval.cli.console import command_line, loudness_options, progress, say
from semgrid_eval.cli.fields import parameters_of
from semgrid_eval.cli.options import FILE_THERE, FOLDER, device_option, logs_argument
from semgrid_eval.cli.types import Whole
from semgrid_eval.config import parse_config
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.words import plural

if TYPE_CHECKING:
    from semgrid_eval.streams.profile import LatencyProfile

_FILE = click.Path(path_type=Path, dir_okay=False)
_MODEL = "One of `run`'s models, or path.py:Class; may be given several times."
_SEGMENT = "ONNX file of a segmentation network that makes the labels; the next options are its own."
_RIGHT = "Folder of right images, FOLDER/<recording>/*.png in the order of frames; disparity is matched then."
_CAMERA = "Whose frames are taken, where several cameras of a log have disparity."
_PROCESSOR = "Count processor time, on one thread of a CPU: what the chain takes where nothing else runs."
_SHOWN = ("processor", "cores", "threads", "device", "gpu", "clock")


@click.command(
    "latency",
    params=[
        logs_argument(),
        click.Option(["--model", "models"], multiple=True, help=_MODEL),
        click.Option(["--segment"], type=FILE_THERE, help=_SEGMENT),
        *parameters_of(SegmentationConfig),
        click.Option(["--right"], type=FOLDER, help=_RIGHT),
        click.Option(["--camera"], help=_CAMERA),
        click.Option(["--frames"], type=Whole(1, 100_000), default=300, show_default=True, help="At most."),
        click.Option(
            ["--warm-up"], type=Whole(0), default=20, show_default=True, help="Frames before those that count."
        ),
        click.Option(["--threads"], type=Whole(1, 1024), help="Of networks and matching.  [default: theirs]"),
        click.Option(["--processor-time"], is_flag=True, help=_PROCESSOR),
        click.Option(["--out"], required=True, type=_FILE, help="File of the profile."),
    ],
    epilog="Example: semgrid-eval latency logs/val --model fuse --frames 100 --out profile.json",
)
@device_option
@loudness_options
def command(logs: tuple[Path, ...], out: Path, frames: int, warm_up: int, **given: Any) -> None:  # noqa: ANN401
    """Measure what each stage of a chain takes on this machine, and write the times of all frames to a profile.

    LOG is a log or a folder of logs, whose frames go through the chain one after another, as a vehicle would send them.
    Stages: decode (the pictures), segment (with --segment), match (with --right), grid (projection and rasterising),
    align (grids to the target's place) and each model, for one window. Exposure and transport are not part of it.
    """
    from semgrid_eval.log.store import find_logs
    from semgrid_eval.streams.chain import Amount, Parts, build_chain, measure_chain, profile_of
    from semgrid_eval.streams.profile import write_profile

    own = {name: given.pop(name) for name in SegmentationConfig.model_fields}
    parts = Parts(segmentation=parse_config(SegmentationConfig, own), **given)
    paths = [path for each in logs for path in (find_logs(each) if each.is_dir() else [each])]
    built = build_chain(paths, parts)
    with progress("measure") as watch:
        measured = measure_chain(paths, built.chain, Amount(frames, warm_up), clock=parts.clock, progress=watch)
    profile = profile_of(measured, built.chain.device, command_line(), processor_time=parts.processor_time)
    write_profile(out, profile)
    machine = profile.made_by.machine
    click.echo(", ".join(f"{name} {machine[name]}" for name in _SHOWN if name in machine))
    for line in table(profile):
        click.echo(line)
    for name in built.random:
        say(f"{name} has random weights: it takes as long as if it were trained")
    say(f"{out}: {plural(profile.frames, 'frame')}")


class _Row(NamedTuple):
    """A stage, a model or a whole chain: its samples (N,), and its share of each chain, None where it has no part."""

    label: str
    samples_ms: Sequence[float]
    shares: list[float | None]


def table(profile: "LatencyProfile") -> Iterator[str]:
    """Write a profile as a table: the spread of each stage, its share of all frames' time, and the whole chains."""
    from semgrid_eval.streams.profile import spread

    rows = list(_rows(profile))
    heads = [f"with {name}" for name in profile.models] or ["share"]
    first = max(len(row.label) for row in rows)
    yield " ".join([f"{'ms':<{first}}", f"{'median':>9}", f"{'99 %':>9}", f"{'most':>9}", *heads])
    for row in rows:
        numbers = [f"{value:>9.2f}" for value in spread(row.samples_ms)]
        shares = [
            f"{'' if share is None else format(share, '.1%'):>{len(head)}}"
            for share, head in zip(row.shares, heads, strict=True)
        ]
        yield " ".join([f"{row.label:<{first}}", *numbers, *shares]).rstrip()


def _rows(profile: "LatencyProfile") -> Iterator[_Row]:
    from semgrid_eval.streams.profile import STAGES

    chains: list[str | None] = [*profile.models] or [None]
    whole_ms = [float(profile.chain_ms(name).sum()) or 1.0 for name in chains]
    for stage in (name for name in STAGES if name in profile.stages):
        samples = profile.stages[stage]
        yield _Row(stage, samples, [sum(samples) / whole for whole in whole_ms])
    for name, samples in profile.models.items():
        own = [sum(samples) / whole if each == name else None for each, whole in zip(chains, whole_ms, strict=True)]
        yield _Row(name, samples, own)
    for chain in chains:
        label = "whole" if chain is None else f"whole with {chain}"
        yield _Row(label, profile.chain_ms(chain).tolist(), [None] * len(chains))
