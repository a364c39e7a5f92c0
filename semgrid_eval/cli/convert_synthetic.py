"""`semgrid-eval convert synthetic`: simulated traffic seen by a simulated stereo camera, as logs."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, get_args

import click
from click.core import ParameterSource

from semgrid_eval.cli.console import progress, say
from semgrid_eval.cli.work import chosen_executor, executor_options
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.executors import Executor, available_cores, local_executor
from semgrid_eval.frames.synthetic.benchmark import (
    BENCHMARKS,
    SIZES,
    Benchmark,
    Comparison,
    SizeName,
    compare,
    load_benchmark,
    versions,
)
from semgrid_eval.frames.synthetic.recordings import (
    RecordingPlan,
    Stereo,
    SyntheticConfig,
    plan_recordings,
    render_recording,
)
from semgrid_eval.log.convert import ConversionJob, ConversionSummary, convert_recordings
from semgrid_eval.log.fingerprint import fingerprints
from semgrid_eval.log.store import SUFFIX, find_logs

_Command = Callable[..., Any]
_CACHE = ".towns"
_DEFAULTS = {name: field.default for name, field in SyntheticConfig.model_fields.items()}


def convert(
    out: Path,
    *,
    workers: int,
    cache: Path | None = None,
    executor: Executor | None = None,
    **options: Any,  # noqa: ANN401
) -> ConversionSummary:
    """Simulate towns, draw recordings from them and write their logs; what is there already is kept.

    Args:
        out: folder of the logs; `cache` is a folder inside it unless given.
        workers: processes at once.
        cache: where towns are kept.
        executor: renders the recordings; by default those processes.
        options: fields of `SyntheticConfig`.

    Raises:
        ConfigError: an option is unknown or impossible.
        InputError: SUMO failed, or a folder cannot be written to.
        MissingExtraError: SUMO or Embree is not installed.
    """
    config = parse_config(SyntheticConfig, options)
    with progress("simulate") as watch:
        plans = plan_recordings(config, cache or out / _CACHE, watch, workers=workers)
    return _render(plans, out, executor or local_executor(workers))


def convert_benchmark(
    out: Path,
    benchmark: Benchmark,
    size: SizeName,
    *,
    workers: int,
    cache: Path | None = None,
    executor: Executor | None = None,
) -> tuple[ConversionSummary, Comparison | None]:
    """Write the logs of a frozen benchmark and hold them against the published ones.

    Args:
        out: folder of the logs; `cache` is a folder inside it unless given.
        benchmark: its definition.
        size: of the benchmark.
        workers: processes at once.
        cache: where towns are kept.
        executor: renders the recordings; by default those processes.

    Raises:
        InputError: SUMO failed, a folder cannot be written to, or a log cannot be read again.
        MissingExtraError: SUMO or Embree is not installed.
    """
    with progress("simulate") as watch:
        plans = plan_recordings(
            benchmark.config(size), cache or out / _CACHE, watch, workers=workers, dataset=benchmark.dataset(size)
        )
    summary = _render(plans, out, executor or local_executor(workers))
    if summary.failed:
        return summary, None
    labels = sorted(summary.written + summary.skipped)
    with progress("compare") as watch:
        found = fingerprints([out / f"{x}{SUFFIX}" for x in labels], executor=local_executor(workers), progress=watch)
    return summary, compare(benchmark.sizes[size], dict(zip(labels, found, strict=True)))


def _render(plans: list[RecordingPlan], out: Path, executor: Executor) -> ConversionSummary:
    jobs = [ConversionJob(plan.name, plan.split, plan.digest, partial(render_recording, plan)) for plan in plans]
    with progress("render") as watch:
        return convert_recordings(jobs, out, executor=executor, progress=watch)


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
@click.option(
    "--workers", type=click.IntRange(1, 256), default=available_cores(), show_default="all cores", help="Processes."
)
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
    from semgrid_eval.cli.convert import show

    given = [name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]
    if benchmark is None:
        if context.get_parameter_source("size") is ParameterSource.COMMANDLINE:
            raise ConfigError("is the size of a benchmark; name one with --benchmark", field="--size")
        if options["recordings"] is None:
            raise click.UsageError("Missing option '--recordings', or '--benchmark'.", context)
        work_on = chosen_executor(executor, address, workers)
        return show(convert(out, workers=workers, cache=cache, executor=work_on, **options), out)
    if given:
        raise ConfigError(f"is fixed by --benchmark {benchmark}; leave it out", field=f"--{given[0].replace('_', '-')}")
    frozen, work_on = load_benchmark(benchmark), chosen_executor(executor, address, workers)
    summary, comparison = convert_benchmark(out, frozen, size, workers=workers, cache=cache, executor=work_on)
    return _show_benchmark(out, frozen, size, summary, comparison)


def _show_benchmark(
    out: Path, benchmark: Benchmark, size: SizeName, summary: ConversionSummary, comparison: Comparison | None
) -> int:
    from semgrid_eval.cli.convert import show

    code = show(summary, out)
    known = set(summary.written + summary.skipped + list(summary.failed))
    strays = [log for log in find_logs(out) if log.relative_to(out).with_suffix("").as_posix() not in known]
    if strays:
        say(f"Warning: {out} holds {len(strays)} logs that do not belong to the benchmark, such as {strays[0]}")
    say(_verdict(f"{benchmark.name} {size}", comparison, len(known), benchmark.sizes[size].versions))
    return code


def _verdict(name: str, comparison: Comparison | None, total: int, made_with: dict[str, str]) -> str:
    """Say in one line whether the recordings are the published ones."""
    if comparison is None:
        return f"Warning: {name}: not compared with what is published, since recordings failed"
    if comparison.published is None:
        return f"{name}: digest {comparison.digest}; nothing is published yet to compare it with"
    if comparison.digest == comparison.published:
        return f"{name}: digest {comparison.digest}, as published"
    here = versions()
    others = [
        f"{what} {made_with[what]} (here {here.get(what)})" for what in made_with if here.get(what) != made_with[what]
    ]
    why = (
        f"published were made with {', '.join(others)}" if others else "the versions are the same, so processors differ"
    )
    return (
        f"Warning: {name}: {len(comparison.differing)} of {total} recordings differ from the published ones, such as "
        f"{comparison.differing[0]}; digest {comparison.digest}, published {comparison.published}; {why}"
    )
