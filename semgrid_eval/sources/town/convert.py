"""The simulated town as logs: any, or a frozen data set, which is compared with what is published."""

import platform
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from semgrid_eval.executors import local_executor
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs
from semgrid_eval.log.fingerprint import fingerprints
from semgrid_eval.log.store import SUFFIX
from semgrid_eval.packages import installed_versions
from semgrid_eval.sources.benchmarks import Benchmark, Comparison, SizeName, compare, load_benchmark
from semgrid_eval.sources.town.config import CACHE, NoOptions, SizeOptions, SyntheticConfig
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RENDER_VERSION, render_recording
from semgrid_eval.sources.town.town import TOWN_VERSION

_PACKAGES = ("numpy", "opencv-python-headless", "eclipse-sumo", "embreex")


def convert_town(
    config: SyntheticConfig, out: Path, work: Work = IN_PROCESS, *, dataset: str = "synthetic"
) -> ConversionSummary:
    """Simulate towns, draw recordings from them and write their logs; what is there already is kept.

    Towns are kept in the cache of `work`; the logs carry the name `dataset`.
    """
    with work.stage("simulate") as progress:
        cache = work.cache or out / CACHE
        plans = plan_recordings(config, cache, progress, workers=work.workers, dataset=dataset)
    jobs = [ConversionJob(plan.name, plan.split, plan.digest, partial(render_recording, plan)) for plan in plans]
    return convert_jobs(jobs, out, work, label="render")


def convert_town_v1(options: SizeOptions, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of town-v1 as `convert_benchmark` does."""
    return convert_benchmark(load_benchmark("town-v1"), options.size, out, work)


def convert_town_rig_v1(_: NoOptions, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of town-rig-v1 as `convert_benchmark` does."""
    return convert_benchmark(load_benchmark("town-rig-v1"), "small", out, work)


def convert_benchmark(benchmark: Benchmark, size: SizeName, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of a benchmark and, if none failed, compare them with the published ones."""
    summary = convert_town(config_of(benchmark, size), out, work, dataset=benchmark.dataset(size))
    summary.all_splits = True
    comparison = None
    if not summary.failed:
        labels = sorted(summary.labels)
        logs = [out / f"{label}{SUFFIX}" for label in labels]
        with work.stage("compare") as progress:
            found = fingerprints(logs, executor=local_executor(work.workers), progress=progress)
        comparison = compare(benchmark.sizes[size], dict(zip(labels, found, strict=True)))
    _judge(summary, f"{benchmark.name} {size}", comparison, benchmark.sizes[size].versions)
    return summary


def config_of(benchmark: Benchmark, size: SizeName) -> SyntheticConfig:
    """Return what `plan_recordings` needs for one size of a benchmark."""
    chosen = benchmark.sizes[size]
    recordings = chosen.train.recordings + chosen.val.recordings
    same = {
        name: getattr(benchmark, name) for name in ("width", "height", "stereo", "rig", "town_size_m", "duration_s")
    }
    return SyntheticConfig(
        recordings=recordings,
        seed=chosen.seed,
        towns=chosen.train.towns + chosen.val.towns,
        val_share=chosen.val.recordings / recordings,
        val_towns=chosen.val.towns,
        **same,
    )


def changed_versions(made_with: Mapping[str, str]) -> dict[str, tuple[str, str | None]]:
    """Return what published recordings were made with and what is here instead, None where nothing is."""
    here = versions()
    return {what: (theirs, here.get(what)) for what, theirs in made_with.items() if here.get(what) != theirs}


def versions() -> dict[str, str]:
    """Return the versions of what the bytes of a recording depend on, and the processor's kind."""
    own = {"processor": platform.machine(), "town builder": str(TOWN_VERSION), "renderer": str(RENDER_VERSION)}
    return dict(sorted((own | installed_versions(_PACKAGES)).items()))


def _judge(summary: ConversionSummary, name: str, comparison: Comparison | None, made_with: Mapping[str, str]) -> None:
    """Note in one line whether the recordings are the published ones, as a warning where they are not."""
    if comparison is None:
        summary.warning = f"{name}: not compared with what is published, since recordings failed"
    elif comparison.published is None:
        summary.remark = f"{name}: digest {comparison.digest}; nothing is published yet to compare it with"
    elif comparison.digest == comparison.published:
        summary.remark = f"{name}: digest {comparison.digest}, as published"
    else:
        summary.warning = (
            f"{name}: {len(comparison.differing)} of {len(summary.labels)} recordings differ from the published ones, "
            f"such as {comparison.differing[0]}; digest {comparison.digest}, published {comparison.published}; "
            f"{_why(made_with)}"
        )


def _why(made_with: Mapping[str, str]) -> str:
    """Say why recordings may differ from published ones."""
    changes = changed_versions(made_with).items()
    others = ", ".join(f"{what} {theirs} (here {ours})" for what, (theirs, ours) in changes)
    return f"published were made with {others}" if others else "the versions are the same, so processors differ"
