"""`semgrid-eval convert synthetic`: simulated traffic seen by a simulated stereo camera, as logs."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from semgrid_eval.cli.console import progress
from semgrid_eval.config import parse_config
from semgrid_eval.executors import available_cores, local_executor
from semgrid_eval.frames.synthetic.recordings import SyntheticConfig, plan_recordings, render_recording
from semgrid_eval.log.convert import ConversionJob, ConversionSummary, convert_recordings

_Command = Callable[..., Any]
_CACHE = ".towns"
_DEFAULTS = {name: field.default for name, field in SyntheticConfig.model_fields.items()}


def convert(out: Path, *, workers: int, cache: Path | None = None, **options: Any) -> ConversionSummary:  # noqa: ANN401
    """Simulate towns, draw recordings from them and write their logs; what is there already is kept.

    Args:
        out: folder of the logs; `cache` is a folder inside it unless given.
        workers: processes at once.
        cache: where towns are kept.
        options: fields of `SyntheticConfig`.

    Raises:
        ConfigError: an option is unknown or impossible.
        InputError: SUMO failed, or a folder cannot be written to.
        MissingExtraError: SUMO or Embree is not installed.
    """
    config = parse_config(SyntheticConfig, options)
    with progress("simulate") as watch:
        plans = plan_recordings(config, cache or out / _CACHE, watch, workers=workers)
    jobs = [ConversionJob(plan.name, plan.split, plan.digest, partial(render_recording, plan)) for plan in plans]
    with progress("render") as watch:
        return convert_recordings(jobs, out, executor=local_executor(workers), progress=watch)


def _option(name: str, kind: "type | click.Choice[str]", text: str) -> Callable[[_Command], _Command]:
    """Return the option for a field of the configuration, whose default and limits it shares."""
    return click.option(
        f"--{name.replace('_', '-')}", name, type=kind, default=_DEFAULTS[name], show_default=True, help=text
    )


@click.command(
    "synthetic",
    epilog="Example: semgrid-eval convert synthetic logs --recordings 2 --towns 2 --town-size-m 250 --duration-s 15",
)
@click.argument("out", type=click.Path(path_type=Path, file_okay=False))
@click.option("--recordings", type=int, required=True, help="How many, of 30 frames each.")
@_option("seed", int, "The same seed gives the same bytes.")
@_option("towns", int, "How many; each belongs to one split only.")
@_option("val_share", float, "Of recordings and of towns that are for validation.")
@_option("town_size_m", float, "Side of the square that a town's streets cover.")
@_option("duration_s", float, "Simulated time of a town from which recordings are taken.")
@_option("width", int, "Of the images in pixels.")
@_option("height", int, "Of the images in pixels.")
@_option("stereo", click.Choice(["modelled", "matched", "exact"]), "Errors of labels, disparity and motion.")
@click.option(
    "--cache", type=click.Path(path_type=Path, file_okay=False), help="Folder of towns.  [default: OUT/.towns]"
)
@click.option(
    "--workers", type=click.IntRange(1, 256), default=available_cores(), show_default="all cores", help="Processes."
)
def synthetic(out: Path, workers: int, cache: Path | None, **options: Any) -> int:  # noqa: ANN401
    """Simulate towns and drive through them: logs OUT/<split>/town<NN>_<recording>_000000.mcap.

    Traffic comes from Eclipse SUMO, pictures from ray casting with Embree; exact labels, disparity, instances, the pose
    and all road users with their velocities are on topics of their own. Training and validation have different towns.
    Logs that are up to date are left as they are, so that the same command goes on after a stop.
    """
    from semgrid_eval.cli.convert import show

    return show(convert(out, workers=workers, cache=cache, **options), out)
