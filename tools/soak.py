"""Converts, trains and reports under disturbances, again and again, and compares what is left with an undisturbed run.

python tools/soak.py WORK [--kills 200] [--seed 0] [--no-renames]

First one command after the other is killed at each of its renames, and run again undisturbed. Then cycles of all three
are killed at random moments, stopped and continued, starved of disk (files of a limited size, and a file system of one
MiB where one can be mounted), and run twice at once in one folder, until so many kills are done; in the end each cycle
is run undisturbed. All tables, sums, predictions, windows, weights and logs have to be the same bytes as those of a run
that nobody disturbed, and no attempt may print a traceback. Exit code 1 where that is not so.
"""

import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from semgrid_eval import places
from semgrid_eval.cli.main import main
from semgrid_eval.executors import thread_variables

MATRIX = """
seed: 1
models: {ed: {features: 4, depth: 2, training: {epochs: 2, updates_per_epoch: 2, batch: 2, precision: float32}}}
rows:
- {name: BL-DC, model: newest}
- {name: ED, model: ed}
"""
KEPT = (
    "logs/*/*.mcap",
    "run/results/*/sums.npz",
    "run/results/*/predictions.npz",
    "run/windows/*.npz",
    "run/trainings/*/weights.safetensors",
    "report/scores.csv",
    "report/tables/*",
)
_TIMES = "costs"  # the name of the tables of what a run cost
_COMMANDS = ("convert", "run", "report")
_LONGEST_S = 600.0  # an attempt that takes longer hangs
_MOST_KILLS = 8  # of one cycle


@dataclass
class Soak:
    """One soak: its folder, what it has found, and how long an undisturbed cycle takes."""

    work: Path
    chance: random.Random
    done: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    cycle_s: float = 0.0
    expected: dict[str, str] = field(default_factory=dict)

    def commands(self, folder: Path) -> dict[str, list[str]]:
        """Return the three commands of a cycle, by their names."""
        logs, run = str(folder / "logs"), str(folder / "run")
        town = [
            "--recordings",
            "2",
            "--towns",
            "2",
            "--val-share",
            "0.5",
            "--town-size-m",
            "250",
            "--duration-s",
            "15",
            "--width",
            "96",
        ]
        size = ["--height", "48", "--cache", str(self.work / "towns"), "--workers", "1"]
        return {
            "convert": ["convert", "synthetic", logs, *town, *size],
            "run": ["run", str(self.work / "soak.yaml"), "--logs", logs, "--out", run, "--workers", "1"],
            "report": ["report", run, "--out", str(folder / "report")],
        }

    def start(self, folder: Path, names: Sequence[str] = _COMMANDS, before: Callable[[], None] | None = None) -> int:
        """Start commands of a cycle in a process, after `before` there, and return its number."""
        folder.mkdir(parents=True, exist_ok=True)
        pid = os.fork()
        if pid == 0:
            code = 70
            with suppress(BaseException):
                code = self._work(folder, names, before)
            os._exit(code)
        return pid

    def _work(self, folder: Path, names: Sequence[str], before: Callable[[], None] | None) -> int:
        output = os.open(folder.with_suffix(".err"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        os.dup2(output, 1)
        os.dup2(output, 2)
        if before is not None:
            before()
        commands = self.commands(folder)
        return next((code for code in (call(commands[name]) for name in names) if code), 0)

    def finish(self, folder: Path, names: Sequence[str] = _COMMANDS) -> None:
        """Run undisturbed to the end, and compare."""
        code = wait(self.start(folder, names))
        if code:
            self.fault(folder, f"the undisturbed end of it has exit code {code}")
        self.look_for_tracebacks(folder)

    def compare(self, folder: Path) -> None:
        """Compare what was left with what was left undisturbed."""
        found = digests(folder)
        differing = sorted(
            name for name in self.expected.keys() | found.keys() if self.expected.get(name) != found.get(name)
        )
        if differing:
            self.fault(folder, f"{len(differing)} files differ: {', '.join(differing[:4])}")
        left = [str(path) for path in folder.rglob(".*.part")]
        if left:
            self.fault(folder, f"left over: {', '.join(left[:4])}")

    def look_for_tracebacks(self, folder: Path) -> None:
        """Note the tracebacks that attempts have printed."""
        errors = folder.with_suffix(".err")
        if errors.exists() and "Traceback" in errors.read_text(errors="replace"):
            self.fault(folder, f"a traceback in {errors}")

    def fault(self, folder: Path, text: str) -> None:
        """Note a fault and say it at once."""
        self.faults.append(f"{folder.name}: {text}")
        say(f"FAULT {self.faults[-1]}")


def call(command: list[str]) -> int:
    """Call a command in this process: -> its exit code."""
    try:
        main(command)
    except SystemExit as error:
        return int(error.code or 0)
    return 0


def say(text: str) -> None:
    """Print a line at once."""
    print(text, flush=True)  # noqa: T201 - a tool's output


def wait(pid: int) -> int:
    """Wait for a process, at most until it hangs: -> exit code, negative for a signal."""
    end_s = time.monotonic() + _LONGEST_S
    while time.monotonic() < end_s:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return -99


def digests(folder: Path) -> dict[str, str]:
    """Digest what has to be the same bytes, by path."""
    files = [path for pattern in KEPT for path in folder.glob(pattern) if path.is_file() and path.stem != _TIMES]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def at_renames(act: Callable[[int], None]) -> None:
    """Have `act` told of the number of each rename, from 1, before it is made."""
    count = 0

    def counted(rename: Callable[..., object]) -> Callable[..., object]:
        def first(*arguments: object, **options: object) -> object:
            nonlocal count
            count += 1
            act(count)
            return rename(*arguments, **options)

        return first

    os.rename, os.replace = counted(os.rename), counted(os.replace)  # type: ignore[assignment]
    places.exchange = counted(places.exchange)  # type: ignore[assignment]


def renames_of(soak: Soak, name: str) -> int:
    """Count the renames of one command."""
    folder, counter = soak.work / f"count-{name}", soak.work / f"count-{name}.txt"
    copy_before(soak, folder, name)

    def note(number: int) -> None:
        counter.write_text(str(number))

    code = wait(soak.start(folder, [name], lambda: at_renames(note)))
    if code:
        soak.fault(folder, f"exit code {code}")
    shutil.rmtree(folder)
    return int(counter.read_text())


def copy_before(soak: Soak, folder: Path, name: str) -> None:
    """Lay what the commands before one have left undisturbed."""
    folder.mkdir()
    for place in {"convert": (), "run": ("logs",), "report": ("logs", "run")}[name]:
        shutil.copytree(soak.work / "undisturbed" / place, folder / place)


def kill_at_every_rename(soak: Soak) -> None:
    """Kill each command before each of its renames, and run it again."""
    for name in _COMMANDS:
        total = renames_of(soak, name)
        say(f"{name}: {total} renames")
        for number in range(1, total + 1):
            folder = soak.work / f"rename-{name}-{number}"
            copy_before(soak, folder, name)

            def kill(n: int, chosen: int = number) -> None:
                if n == chosen:
                    os.kill(os.getpid(), signal.SIGKILL)

            code = wait(soak.start(folder, [name], lambda act=kill: at_renames(act)))  # type: ignore[misc]
            if code != -signal.SIGKILL:
                soak.fault(folder, f"was to be killed, and has exit code {code}")
            soak.done["killed at a rename"] += 1
            soak.finish(folder, _COMMANDS[_COMMANDS.index(name) :] if name == "report" else [name])
            compare_part(soak, folder)


def compare_part(soak: Soak, folder: Path) -> None:
    """Compare what there is of a cycle, and remove it where it is right."""
    whole, faults = soak.expected, len(soak.faults)
    tops = {path.name for path in folder.iterdir()}
    soak.expected = {name: digest for name, digest in whole.items() if name.partition("/")[0] in tops}
    soak.compare(folder)
    soak.expected = whole
    if len(soak.faults) == faults:
        shutil.rmtree(folder)


def disturbed_cycles(soak: Soak, kills: int) -> None:
    """Disturb cycles until so many kills are done."""
    number = 0
    while soak.done["killed at random"] < kills:
        folder = soak.work / f"cycle-{number}"
        mounted = soak.chance.random() < 0.2 and mount(folder)
        for _ in range(min(_MOST_KILLS, kills - soak.done["killed at random"])):
            disturb(soak, folder)
        if mounted:
            subprocess.run(["mount", "-o", "remount,size=1g", str(folder)], check=True)
            soak.done["small disk"] += 1
        soak.finish(folder)
        compare_part(soak, folder) if not mounted else soak.compare(folder)
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)
        number += 1
        soak.done["cycles"] += 1
        say(f"cycle {number}: {dict(soak.done)}")


def disturb(soak: Soak, folder: Path) -> None:
    """Make one attempt at a cycle that is disturbed in some way, and killed at a random moment if it still runs."""
    how = soak.chance.choice(["kill", "kill", "kill", "stop", "full", "two"])
    limit = 1 << soak.chance.randint(8, 18)
    before = (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))) if how == "full" else None
    pids = [soak.start(folder, before=before)] + ([soak.start(folder)] if how == "two" else [])
    soak.done[how] += how != "kill"
    for pid in pids:
        time.sleep(soak.chance.uniform(0.02, soak.cycle_s))
        if how == "stop":
            os.kill(pid, signal.SIGSTOP)
            time.sleep(soak.chance.uniform(0.02, 0.3))
            os.kill(pid, signal.SIGCONT)
            time.sleep(soak.chance.uniform(0.02, soak.cycle_s / 2))
        os.kill(pid, signal.SIGKILL)
        soak.done["killed at random"] += wait(pid) == -signal.SIGKILL


def mount(folder: Path) -> bool:
    """Mount a file system of a few MiB; False where that is not allowed."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("work", type=Path, help="new folder for all of it")
    parser.add_argument("--kills", type=int, default=200, help="at random moments")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-renames", action="store_true", help="skip the kills at renames")
    return parser.parse_args()


def soak_it() -> int:
    """Do all of it, and print what was done as JSON."""
    options = arguments()
    options.work.mkdir(parents=True)
    soak = Soak(options.work.resolve(), random.Random(options.seed))
    (soak.work / "soak.yaml").write_text(MATRIX)
    for command in soak.commands(soak.work / "warm").values():
        call(command)  # so that whatever is imported and compiled is there in each attempt
    for name in ("undisturbed", "again"):
        start_s = time.monotonic()
        soak.finish(soak.work / name)
        soak.cycle_s = time.monotonic() - start_s
        say(f"{name}: {soak.cycle_s:.1f} s")
    soak.expected = digests(soak.work / "undisturbed")
    soak.compare(soak.work / "again")
    if not options.no_renames:
        kill_at_every_rename(soak)
    disturbed_cycles(soak, options.kills)
    say(json.dumps({"done": dict(soak.done), "compared": len(soak.expected), "faults": soak.faults}))
    return 1 if soak.faults or not soak.expected else 0


if __name__ == "__main__":
    if any(
        os.environ.get(name) != value for name, value in thread_variables(1).items()
    ):  # no threads, which no fork has
        os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | thread_variables(1))
    sys.exit(soak_it())
