"""Make some recordings of a benchmark again and compare their fingerprints with the published ones.

Example: python tools/check_benchmark.py --cache towns --recordings 30
"""

# ruff: noqa: T201 - the result goes to stdout

import argparse
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from semgrid_eval.errors import SemgridError
from semgrid_eval.executors import available_cores, local_executor
from semgrid_eval.log.fingerprint import fingerprint
from semgrid_eval.log.store import write_log
from semgrid_eval.progress import silent
from semgrid_eval.sources.benchmarks import (
    BENCHMARKS,
    SIZES,
    Benchmark,
    SizeName,
    load_benchmark,
    short_fingerprints,
)
from semgrid_eval.sources.town.convert import changed_versions, config_of
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording


def rendered(benchmark: Benchmark, size: SizeName, cache: Path, count: int) -> dict[str, tuple[str, str]]:
    """Render `count` recordings spread over a size; return what is found and published by split and name."""
    workers = available_cores()
    config, dataset = config_of(benchmark, size), benchmark.dataset(size)
    plans = plan_recordings(config, cache, silent, workers=workers, dataset=dataset)
    by_label = {f"{plan.split}/{plan.name}": plan for plan in plans}
    published = dict(zip(sorted(by_label), (benchmark.sizes[size].fingerprints or "").split(), strict=True))
    some = _spread(sorted(by_label), count)
    with tempfile.TemporaryDirectory() as folder:
        work = partial(_fingerprint, folder=Path(folder))
        found = dict(local_executor(workers).run(work, [by_label[label] for label in some]))
    short = short_fingerprints({some[index]: str(outcome) for index, outcome in found.items()})
    return {label: (short[label], published[label]) for label in some}


def _spread(labels: Sequence[str], count: int) -> list[str]:
    return [labels[index * len(labels) // count] for index in range(count)]


def _fingerprint(plan: RecordingPlan, folder: Path) -> str:
    path = folder / f"{plan.name}.mcap"
    write_log(render_recording(plan), path)
    found = fingerprint(path)
    path.unlink()
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--benchmark", choices=BENCHMARKS, default=BENCHMARKS[0])
    parser.add_argument("--size", choices=SIZES, default="small")
    parser.add_argument("--cache", type=Path, required=True, help="folder of towns")
    parser.add_argument("--recordings", type=int, default=30)
    given = parser.parse_args()
    benchmark = load_benchmark(given.benchmark)
    if given.size not in benchmark.sizes:
        raise SystemExit(f"Error: {benchmark.name} has no size {given.size}")
    try:
        found = rendered(benchmark, given.size, given.cache, given.recordings)
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None
    for label, (here, published) in found.items():
        print(label, here, "as published" if here == published else f"differs from the published {published}")
    for what, (theirs, ours) in changed_versions(benchmark.sizes[given.size].versions).items():
        print(f"published were made with {what} {theirs}, here {ours}")
    raise SystemExit(any(here != published for here, published in found.values()))
