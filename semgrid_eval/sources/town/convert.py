"""The simulated town as logs: planned, rendered and, where it is a benchmark, held against what is published."""

from functools import partial
from pathlib import Path

from semgrid_eval.executors import Executor, local_executor
from semgrid_eval.log.benchmarks import Benchmark, Comparison, SizeName, compare
from semgrid_eval.log.convert import ConversionJob, ConversionSummary, convert_recordings
from semgrid_eval.log.fingerprint import fingerprints
from semgrid_eval.log.store import SUFFIX
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.sources.town.benchmark import config_of
from semgrid_eval.sources.town.recordings import SyntheticConfig, plan_recordings, render_recording

CACHE = ".towns"


def convert_town(
    config: SyntheticConfig,
    out: Path,
    *,
    workers: int,
    cache: Path | None = None,
    executor: Executor | None = None,
    dataset: str = "synthetic",
    stage: Stage = silent_stage,
) -> ConversionSummary:
    """Simulate towns, draw recordings from them and write their logs; what is there already is kept.

    Args:
        config: of the data set.
        out: folder of the logs.
        workers: processes at once.
        cache: where towns are kept; by default `CACHE` in the folder of the logs.
        executor: renders the recordings; by default those processes.
        dataset: the name that the logs carry.
        stage: shows progress.

    Raises:
        InputError: SUMO failed, or a folder cannot be written to.
        MissingExtraError: SUMO or Embree is not installed.
    """
    with stage("simulate") as progress:
        plans = plan_recordings(config, cache or out / CACHE, progress, workers=workers, dataset=dataset)
    jobs = [ConversionJob(plan.name, plan.split, plan.digest, partial(render_recording, plan)) for plan in plans]
    with stage("render") as progress:
        return convert_recordings(jobs, out, executor=executor or local_executor(workers), progress=progress)


def convert_benchmark(
    benchmark: Benchmark,
    size: SizeName,
    out: Path,
    *,
    workers: int,
    cache: Path | None = None,
    executor: Executor | None = None,
    stage: Stage = silent_stage,
) -> tuple[ConversionSummary, Comparison | None]:
    """Write the logs of a frozen benchmark and hold them against the published ones, if none failed.

    Arguments are those of `convert_town`.

    Raises:
        InputError: SUMO failed, a folder cannot be written to, or a log cannot be read again.
        MissingExtraError: SUMO or Embree is not installed.
    """
    config, dataset = config_of(benchmark, size), benchmark.dataset(size)
    summary = convert_town(config, out, workers=workers, cache=cache, executor=executor, dataset=dataset, stage=stage)
    if summary.failed:
        return summary, None
    labels = sorted(summary.written + summary.skipped)
    logs = [out / f"{label}{SUFFIX}" for label in labels]
    with stage("compare") as progress:
        found = fingerprints(logs, executor=local_executor(workers), progress=progress)
    return summary, compare(benchmark.sizes[size], dict(zip(labels, found, strict=True)))
