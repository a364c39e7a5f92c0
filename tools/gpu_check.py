"""Check semgrid-eval on a GPU, on a machine without a network: tests, rates, the paper at its own scale, presets.

Example: python tools/gpu_check.py pack CARRY --logs LOGS
         python tools/gpu_check.py run --data CARRY --out OUT --part tests:90 --part rates:150 --part paper:270
         python tools/gpu_check.py run --data CARRY --out OUT --part reference:200 --weights reference --jobs 8
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any, TypeVar

import torch

from semgrid_eval.bench.archives import pack_run
from semgrid_eval.bench.gpu import SHARE_GOAL, SMOKE, Size, measure_gpu
from semgrid_eval.bench.measurement import Measurement
from semgrid_eval.bench.paper import AGAINST, matrix_of_grids, paper_matrix, price_of_paper, scores_of
from semgrid_eval.errors import InputError
from semgrid_eval.executors import Executor, InProcess, Processes, WorkerDied, available_cores
from semgrid_eval.files import read_json, write_json
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.models.device import choose_device, visible_gpus
from semgrid_eval.presets import preset_names
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.packed import pack_grids
from semgrid_eval.runs.record import machine, versions
from semgrid_eval.runs.runner import RunOptions, run_matrix

T = TypeVar("T")
R = TypeVar("R")

ROOT = Path(__file__).resolve().parent.parent
REFERENCE = ROOT / "reports" / "reference"
CARRIED_MB = 50
BUDGET_S = {"tests": 90, "rates": 150, "paper": 270}
"""The parts, and for how many seconds each may work unless it is said otherwise."""
PRESET_S = 200
"""For how many seconds a preset may work unless it is said otherwise."""
WORTH_SHARING = 1.15
"""How many times as fast several processes must train together, that rows are trained beside each other."""


@dataclass(frozen=True)
class Place:
    """What a part works with, and where it leaves its figures, each time that it has some more."""

    part: str
    data: Path
    out: Path
    device: str
    commit: str
    smoke: bool
    jobs: int | None = None  # processes that train at once, by default as many as `rates` advises

    @property
    def run(self) -> Path:
        """Where a part runs a matrix."""
        return self.out.with_name(f"{self.out.name}-work") / self.part / "run"

    def keep(self, *, complete: bool = False, **figures: object) -> None:
        """Write what is known so far with the card, the versions and the commit that it was measured with."""
        known = versions()
        head = {
            "part": self.part,
            "commit": self.commit or known.get("semgrid-eval (commit)", "unknown"),
            "machine": machine(choose_device(self.device), torch.get_num_threads()),
            "versions": known,
            "smoke": self.smoke,
            "complete": complete,
        }
        write_json(self.out / f"{self.part}.json", {**head, **figures})


def check_tests(place: Place) -> None:
    """Run the tests that need a CUDA device, and keep the outcome of each."""
    log = place.out / "tests.log"
    command = [sys.executable, "-m", "pytest", "-m", "cuda", "-vv", "-rs", "--color=no", "-W", "default"]
    chosen = sorted(ROOT.glob("tests/*/test_cuda.py"))
    with log.open("w", encoding="utf-8") as stream:
        tests = subprocess.Popen([*command, *chosen], cwd=ROOT, stdout=stream, stderr=subprocess.STDOUT)
        while tests.poll() is None:
            time.sleep(0.5)
            place.keep(tests=outcomes(log))
    place.keep(complete=True, tests=outcomes(log))
    if tests.returncode:
        raise InputError(f"tests failed, see {log}")


def outcomes(log: Path) -> dict[str, str]:
    """Read the outcome of each test from what pytest has said so far."""
    text = log.read_text(encoding="utf-8", errors="replace")
    return dict(re.findall(r"^(tests/\S+?::.+?) (PASSED|FAILED|SKIPPED|ERROR)\b", text, flags=re.MULTILINE))


def check_rates(place: Place) -> None:
    """Measure training and prediction beside the product of matrices."""
    figures: dict[str, dict[str, object]] = {}
    failed: list[str] = []
    for found in measure_gpu(SMOKE if place.smoke else Size(), choose_device(place.device)):
        if isinstance(found, Measurement):
            figures[found.what] = {"value": float(f"{found.value:.4g}"), "unit": found.unit}
        else:
            failed.append(found)
        place.keep(figures=figures, failed=failed, share_goal_percent=SHARE_GOAL)
    place.keep(complete=True, figures=figures, failed=failed, share_goal_percent=SHARE_GOAL)


def check_paper(place: Place) -> None:
    """Train and score the rows of the paper one after the other, the most telling ones first, as long as it may.

    It begins anew each time: what an earlier run has trained would cost this one nothing, and the price be too low.
    """
    rmtree(place.run, ignore_errors=True)
    train_and_score(place, paper_matrix(smoke=place.smoke), lambda: {"whole_preset": price_of_paper(place.run)})


def check_preset(place: Place) -> None:
    """Train and score what a preset has for grids alone; what an earlier run has trained is found."""
    train_and_score(place, matrix_of_grids(place.part, smoke=place.smoke), dict)


def train_and_score(place: Place, matrix: Matrix, more: Callable[[], dict[str, object]]) -> None:
    """Run a matrix, and keep its scores, and what else is told of it, after each row."""
    count, run = place.jobs or processes_at_once(place.out / "rates.json"), place.run

    def keep(*, complete: bool = False) -> None:
        place.keep(complete=complete, processes=count, rows=scores_of(run, REFERENCE), **more())

    inner = Processes(count, gpus=visible_gpus()[:1]) if count > 1 else InProcess()
    options = RunOptions(place.device, run / "grids", "gpu_check.py", executor=Telling(inner, keep), pictures=False)
    run_matrix(matrix, place.data / "grids", run, options)
    keep(complete=True)


def processes_at_once(rates: Path) -> int:
    """Choose how many rows to train at once: as many as trained most windows a second, if that is worth while."""
    figures = read_json(rates)["figures"] if rates.is_file() else {}
    alone = figures.get("trained, eager", {}).get("value", 0.0)
    found = {what: figure["value"] for what, figure in figures.items() if what.startswith("trained by ")}
    counts = {int(match[0]): rate for what, rate in found.items() if (match := re.findall(r"\d+", what))}
    best = max(counts, key=lambda count: counts[count], default=1)
    return best if alone and counts.get(best, 0.0) > WORTH_SHARING * alone else 1


class Telling:
    """An executor that tells when the result of each piece of work is kept."""

    def __init__(self, inner: Executor, tell: Callable[[], None]) -> None:
        self._inner, self._tell = inner, tell
        self.parallel, self.threads = inner.parallel, inner.threads

    def run(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[int, R | WorkerDied]]:
        """Yield what the other executor yields; whoever asks for the next result has kept the last one."""
        for result in self._inner.run(function, items):
            yield result
            self._tell()


CHECKS = {"tests": check_tests, "rates": check_rates, "paper": check_paper}
PARTS = (*CHECKS, *(name for name in preset_names() if name not in CHECKS))


def run_parts(chosen: argparse.Namespace) -> bool:
    """Work on parts one after the other, each in a process that is ended when its time is over; tell if all is well.

    Time that a part leaves is the next one's.
    """
    well, ends_s = True, time.monotonic()
    chosen.out.mkdir(parents=True, exist_ok=True)
    for part, budget_s in chosen.part or BUDGET_S.items():
        started_s, ends_s = time.monotonic(), ends_s + budget_s
        ended = in_time([*sys.argv[:1], "part", part, *passed_on(chosen)], max(0.0, ends_s - started_s))
        pack_run(place_of(chosen, part).run, chosen.out / part, weights=part in chosen.weights)
        took_s = time.monotonic() - started_s
        sys.stdout.write(f"\n== {part}: {ended} after {took_s:.0f} s\n{table(chosen.out / f'{part}.json')}\n")
        sys.stdout.flush()
        well &= ended != "failed"
    return well


def in_time(arguments: list[str], budget_s: float) -> str:
    """Run this script again with these arguments, and end it with all that it has started when its time is over."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    part = subprocess.Popen([sys.executable, *arguments], start_new_session=True, env=environment)
    try:
        return "failed" if part.wait(budget_s) else "complete"
    except subprocess.TimeoutExpired:
        return "stopped at its time"
    finally:
        if part.poll() is None:
            os.killpg(part.pid, signal.SIGKILL)
            part.wait()


def passed_on(chosen: argparse.Namespace) -> list[str]:
    """Return the options that each part gets."""
    options = ["--data", chosen.data, "--out", chosen.out, "--device", chosen.device, "--commit", chosen.commit]
    more = [*(["--smoke"] if chosen.smoke else []), *(["--jobs", chosen.jobs] if chosen.jobs else [])]
    return [*map(str, options), *map(str, more)]


def place_of(chosen: argparse.Namespace, part: str) -> Place:
    """Return what a part works with."""
    return Place(part, chosen.data, chosen.out, chosen.device, chosen.commit, chosen.smoke, chosen.jobs)


def table(path: Path) -> str:
    """Show the figures of a part in a few lines."""
    if not path.is_file():
        return "left no figures"
    found = read_json(path)
    lines = [f"{found['machine'].get('gpu', 'no GPU')}, torch {found['versions'].get('torch')}, {found['commit']}"]
    lines += [f"{name} {outcome}" for name, outcome in found.get("tests", {}).items()]
    lines += [f"{what:60} {each['value']:10.4g} {each['unit']}" for what, each in found.get("figures", {}).items()]
    lines += [f"not measured: {what}" for what in found.get("failed", [])]
    lines += [row_line(name, row) for name, row in found.get("rows", {}).items()]
    if price := found.get("whole_preset"):
        lines.append(f"the paper's own rows, estimated: {price['hours']} h (goal: under {price['goal_hours']:g} h)")
    return "\n".join(lines)


def row_line(name: str, row: dict[str, Any]) -> str:
    """Show a row's mean score with its interval and differences."""
    if "failure" in row:
        return f"{name:12} failed: {row['failure']}"
    mean, kept = row["scores"]["mean_known"], (row["scores_of_reference"] or {}).get("mean_known")
    parts = [f"{name:12} {mean[0]:.3f} [{mean[1]:.3f}, {mean[2]:.3f}]", f"in reports/reference {kept or 'none'}"]
    found = {other: row["minus"][other]["mean_known"] for other in AGAINST if other in row["minus"]}
    parts += [f"minus {other} {value:+.3f} [{low:+.3f}, {high:+.3f}]" for other, (value, low, high) in found.items()]
    return ", ".join([*parts, f"trained {row['train_seconds']} s" if row["train_seconds"] else "not trained"])


def pack(chosen: argparse.Namespace) -> int:
    """Make what is carried, the grids of logs; 1 where that, with what lies beside it, is more than can be carried."""
    rows = paper_matrix().rows
    workers = Processes(available_cores())
    cache, cpu = chosen.cache or chosen.out.with_name(f"{chosen.out.name}-cache"), torch.device("cpu")
    data = RunData(chosen.logs, cache, rows, executor=workers, device=cpu, stage=silent_stage)
    pack_grids(data, GridConfig(), chosen.out / "grids")
    size = sum(path.stat().st_size for path in chosen.out.rglob("*") if path.is_file())
    too_much = f": more than the {CARRIED_MB} MB that can be carried" if size > CARRIED_MB * 1e6 else ""
    sys.stdout.write(f"{chosen.out}: {size / 1e6:.1f} MB, {len(data.failed)} logs failed{too_much}\n")
    return int(bool(too_much))


def budget(text: str) -> tuple[str, float]:
    """Read `PART` or `PART:SECONDS`."""
    part, _, seconds = text.partition(":")
    if part not in PARTS:
        raise argparse.ArgumentTypeError(f"{part!r} is not one of {', '.join(PARTS)}")
    return part, float(seconds or BUDGET_S.get(part, PRESET_S))


def parser() -> argparse.ArgumentParser:
    """Describe the commands."""
    top = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = top.add_subparsers(dest="command", required=True)
    packing = commands.add_parser("pack", help="make the folder to carry along")
    packing.add_argument("out", type=Path)
    packing.add_argument("--logs", type=Path, required=True)
    packing.add_argument("--cache", type=Path, help="folder of grids that are built already")
    running = commands.add_parser("run", help="work on parts, each for so many seconds")
    running.add_argument("--part", type=budget, action="append", help="tests, rates, paper or a preset, with :SECONDS")
    running.add_argument("--weights", action="append", default=[], help="a part whose trained weights are packed, too")
    one = commands.add_parser("part", help="work on one part without a limit of time")
    one.add_argument("name", choices=PARTS)
    for command in (running, one):
        command.add_argument("--data", type=Path, required=True, help="folder that was carried along")
        command.add_argument("--out", type=Path, required=True)
        command.add_argument("--device", default="auto")
        command.add_argument("--commit", default="", help="of this checkout, where git cannot tell it")
        command.add_argument("--jobs", type=int, help="processes that train at once, by default as `rates` advises")
        command.add_argument("--smoke", action="store_true", help="the least of everything, to try the script itself")
    return top


def main() -> int:
    """Do what the command line says; 1 where a part failed."""
    chosen = parser().parse_args()
    if chosen.command == "pack":
        return pack(chosen)
    if chosen.command == "part":
        CHECKS.get(chosen.name, check_preset)(place_of(chosen, chosen.name))
        return 0
    return 0 if run_parts(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
