"""Publish the digest of a benchmark's logs: writes it, with the versions that made them, into the package's definition.

Example: semgrid-eval convert town-v1 town --size small && python tools/freeze_benchmark.py town
"""

# ruff: noqa: T201 - the digest goes to stdout

import sys
from pathlib import Path

from semgrid_eval.errors import InputError, SemgridError
from semgrid_eval.executors import available_cores, local_executor
from semgrid_eval.files import write_json
from semgrid_eval.log.fingerprint import fingerprints
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, label_of
from semgrid_eval.progress import silent
from semgrid_eval.sources.benchmarks import (
    BENCHMARKS,
    SIZES,
    benchmark_digest,
    definition_file,
    load_benchmark,
    short_fingerprints,
)
from semgrid_eval.sources.town.convert import versions


def freeze(out: Path) -> str:
    """Write the fingerprints of all logs below a folder into the definition of their benchmark; return the digest."""
    logs = find_logs(out)
    name, size = _dataset(logs)
    definition = load_benchmark(name).model_dump()
    chosen = definition["sizes"][size]
    expected = chosen["train"]["recordings"] + chosen["val"]["recordings"]
    if len(logs) != expected:
        raise InputError(f"holds {len(logs)} logs, {name} {size} has {expected} recordings", path=out)
    found = fingerprints(logs, executor=local_executor(available_cores()), progress=silent)
    labels = [label_of(log, out) for log in logs]
    short = short_fingerprints(dict(zip(labels, found, strict=True)))
    chosen |= {"fingerprints": " ".join(short.values()), "versions": versions()}
    write_json(definition_file(name), definition)
    return f"{name} {size}: digest {benchmark_digest(short)}"


def _dataset(logs: list[Path]) -> tuple[str, str]:
    """Return the benchmark and the size that all logs are of."""
    known = [f"{name}/{size}" for name in BENCHMARKS for size in SIZES]
    found = known
    for log in logs:
        with LogReader(log) as reader:
            dataset = reader.scene.dataset
        if dataset not in found:
            raise InputError(f"is {dataset}, not {' or '.join(found)}", path=log, field="dataset")
        found = [dataset]
    name, _, size = found[0].partition("/")
    return name, size


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    try:
        print(freeze(Path(sys.argv[1])))
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None
