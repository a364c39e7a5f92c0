"""`semgrid-eval convert synthetic`: simulated traffic seen by a simulated stereo camera, as logs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import click
from click.core import ParameterSource

from semgrid_eval.cli.console import progress, say
from semgrid_eval.cli.convert import show
from semgrid_eval.cli.work import chosen_executor, executor_options, workers_option
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.log.benchmarks import (
    BENCHMARKS,
    SIZES,
    Benchmark,
    Comparison,
    SizeName,
    Stereo,
    load_benchmark,
)
from semgrid_eval.log.convert import ConversionSummary
from semgrid_eval.sources.town.benchmark import changed_versions
from semgrid_eval.sources.town.convert import convert_benchmark, convert_town
from semgrid_eval.sources.town.recordings import SyntheticConfig

_Command = Callable[..., Any]
_DEFAULTS = {name: field.default for name, field in SyntheticConfig.model_fields.items()}


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
@click.option("--recordings", type=int, help="How many, of 30 frames each.  [required without --benchmark]")
@_option("seed", int, "The same seed gives the same bytes.")
@_option("towns", int, "How many; each belongs to one split only.")
@_option("val_share", float, "Of recordings and of towns that are for validation.")
@_option("town_size_m", float, "Side of the square that a town's streets cover.")
@_option("duration_s", float, "Simulated time of a town from which recordings are taken.")
@_option("width", int, "Of the images in pixels.")
@_option("height", int, "Of the images in pixels.")
@_option("stereo", click.Choice(get_args(Stereo)), "Errors of labels, disparity and motion.")
@click.option("--benchmark", type=click.Choice(BENCHMARKS), help="A frozen data set, instead of all options above.")
@click.option("--size", type=click.Choice(SIZES), default="small", show_default=True, help="Of the benchmark.")
@click.option(
    "--cache", type=click.Path(path_type=Path, file_okay=False), help="Folder of towns.  [default: OUT/.towns]"
)
@workers_option("Processes.")
@executor_options
@click.pass_context
def synthetic(
    context: click.Context,
    /,
    out: Path,
    benchmark: str | None,
    size: SizeName,
    workers: int,
    cache: Path | None,
    executor: str,
    address: str,
    **options: Any,  # noqa: ANN401
) -> int:
    """Simulate towns and drive through them: logs OUT/<split>/town<NN>_<recording>_000000.mcap.

    Traffic comes from Eclipse SUMO, pictures from ray casting with Embree; exact labels, disparity, instances, the pose
    and all road users with their velocities are on topics of their own. Training and validation have different towns.
    Logs that are up to date are left as they are, so that the same command goes on after a stop.

    --benchmark town-v1 makes a data set that is the same everywhere: 300 recordings for training and 120 for
    validation, or 2,975 and 500 with --size full. Its last line says whether every recording is the published one.
    """
    given = [name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]
    if benchmark is None:
        if context.get_parameter_source("size") is ParameterSource.COMMANDLINE:
            raise ConfigError("is the size of a benchmark; name one with --benchmark", field="--size")
        if options["recordings"] is None:
            raise click.UsageError("Missing option '--recordings', or '--benchmark'.", context)
        config, work_on = parse_config(SyntheticConfig, options), chosen_executor(executor, address, workers)
        return show(convert_town(config, out, workers=workers, cache=cache, executor=work_on, stage=progress), out)
    if given:
        raise ConfigError(f"is fixed by --benchmark {benchmark}; leave it out", field=f"--{given[0].replace('_', '-')}")
    frozen, work_on = load_benchmark(benchmark), chosen_executor(executor, address, workers)
    summary, comparison = convert_benchmark(
        frozen, size, out, workers=workers, cache=cache, executor=work_on, stage=progress
    )
    return _show_benchmark(out, frozen, size, summary, comparison)


def _show_benchmark(
    out: Path, benchmark: Benchmark, size: SizeName, summary: ConversionSummary, comparison: Comparison | None
) -> int:
    code = show(summary, out, benchmark=True)
    total = len(summary.written) + len(summary.skipped) + len(summary.failed)
    say(_verdict(f"{benchmark.name} {size}", comparison, total, benchmark.sizes[size].versions))
    return code


def _verdict(name: str, comparison: Comparison | None, total: int, made_with: dict[str, str]) -> str:
    """Say in one line whether the recordings are the published ones."""
    if comparison is None:
        return f"Warning: {name}: not compared with what is published, since recordings failed"
    if comparison.published is None:
        return f"{name}: digest {comparison.digest}; nothing is published yet to compare it with"
    if comparison.digest == comparison.published:
        return f"{name}: digest {comparison.digest}, as published"
    others = ", ".join(f"{what} {theirs} (here {ours})" for what, (theirs, ours) in changed_versions(made_with).items())
    why = f"published were made with {others}" if others else "the versions are the same, so processors differ"
    return (
        f"Warning: {name}: {len(comparison.differing)} of {total} recordings differ from the published ones, such as "
        f"{comparison.differing[0]}; digest {comparison.digest}, published {comparison.published}; {why}"
    )
