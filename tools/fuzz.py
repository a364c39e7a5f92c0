"""Mutate what users give and what runs keep: each must be read the same, or refused in one line, and nothing else.

Every case is made from a seed of its own, so that a count names the same cases on every machine. What has checksums
(logs, PNG files, all that a run keeps) must never be read as something else; what has none (YAML, JSON, content that
was changed before its checksums were made) may be read as what it now says.

Example: PYTHONPATH=.:tests python tools/fuzz.py --count 500 --seconds 600
"""

import argparse
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from support import fuzzing
from support.fuzzing_ways import Kind

from semgrid_eval.errors import SemgridError

HANG_S = 60
SAME, REFUSED, OTHER = "same", "refused", "other"
WRONG, TRACEBACK, LINES, HANG = "silently wrong", "traceback", "more than a line", "hang"
FAILURES = (WRONG, TRACEBACK, LINES, HANG)


class Hang(BaseException):
    """A case took longer than any does."""


@dataclass(frozen=True)
class Case:
    """One mutated input: its kind, number, name of the file that it was made of, and content."""

    kind: str
    number: int
    name: str
    data: bytes


Failure = tuple[Case, str, str]
"""A case, what became of it, and its traceback or what else there is to tell."""


@dataclass(frozen=True)
class Tally:
    """What became of the cases of a kind."""

    outcomes: Counter[str]
    failures: list[Failure]
    seconds: float = 0.0


def run_kind(name: str, kind: Kind, count: int, folder: Path, *, seconds: float = float("inf")) -> Tally:
    """Make and read so many cases of a kind, fewer where the time for them is over before."""
    inputs = kind.inputs(folder)
    expected: dict[str, object] = {}
    for each in inputs:
        kind.put(folder, each, inputs[each])
        expected[each] = kind.read(folder, each) if kind.has_checksums else None
    tally, begin_s = Tally(Counter(), []), time.monotonic()
    for case in cases(name, kind, inputs, count):
        if time.monotonic() - begin_s > seconds:
            break
        outcome, told = judged(kind, case, inputs, expected, folder)
        tally.outcomes[outcome] += 1
        if outcome in FAILURES:
            tally.failures.append((case, outcome, told))
    return replace(tally, seconds=time.monotonic() - begin_s)


def cases(name: str, kind: Kind, inputs: Mapping[str, bytes], count: int) -> Iterator[Case]:
    """Make so many cases, none of which is as it was."""
    for number in range(count):
        chance = random.Random(f"{name} {number}")
        chosen = chance.choice(sorted(inputs))
        data = inputs[chosen]
        while data == inputs[chosen]:
            data = kind.mutate(inputs, chosen, chance)
        yield Case(name, number, chosen, data)


def judged(
    kind: Kind, case: Case, inputs: Mapping[str, bytes], expected: Mapping[str, object], folder: Path
) -> tuple[str, str]:
    """Read one case and say what becomes of it; the input is whole again afterwards."""
    kind.put(folder, case.name, case.data)
    try:
        with limited(HANG_S):
            found = kind.read(folder, case.name)
            agrees = kind.agrees(inputs[case.name], case.data, expected[case.name], found)
    except SemgridError as error:
        return (REFUSED, "") if "\n" not in str(error) and str(error) else (LINES, str(error))
    except Hang:
        return HANG, f"over {HANG_S} s"
    except Exception:  # whatever it is, a user would see it as a traceback
        return TRACEBACK, traceback.format_exc()
    finally:
        kind.put(folder, case.name, inputs[case.name])
    if not kind.has_checksums:
        return OTHER, ""
    return (SAME, "") if agrees else (WRONG, f"{found!r:.200}")


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """Raise `Hang` in the block after a time; it is far longer than any case takes on a busy machine."""

    def stop(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def keep(failures: Iterable[Failure], folder: Path) -> None:
    """Write inputs that failed, each beside what became of it."""
    for case, outcome, told in failures:
        place = folder / case.kind.replace(" ", "_") / f"{case.number}-{Path(case.name).name}"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(case.data)
        place.with_name(f"{place.name}.txt").write_text(f"{outcome}\n{told}\n")


def line(name: str, outcomes: Counter[str]) -> str:
    """Return one line of figures."""
    counts = "".join(f"{outcomes[each]:>17}" for each in (SAME, REFUSED, OTHER, *FAILURES))
    return f"{name:<22}{outcomes.total():>8}{counts}\n"


def run_kinds(names: Sequence[str], count: int, seconds: float, folder: Path) -> tuple[Counter[str], list[Failure]]:
    """Run several kinds, each in its share of the time that those before have left, and print a line for each."""
    outcomes, failures = Counter[str](), list[Failure]()
    for left, name in zip(range(len(names), 0, -1), names, strict=True):
        tally = run_kind(name, fuzzing.KINDS[name], count, folder, seconds=seconds / left)
        seconds -= tally.seconds
        outcomes.update(tally.outcomes)
        failures.extend(tally.failures)
        sys.stdout.write(line(name, tally.outcomes))
        sys.stdout.flush()
    return outcomes, failures


def main() -> int:
    """Fuzz all kinds, or some, and print what became of the cases; the exit code is 1 if there is a failure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=500, help="cases of each kind")
    parser.add_argument("--seconds", type=float, default=600.0, help="for the cases of all kinds together")
    parser.add_argument("--kinds", nargs="*", default=[*fuzzing.KINDS], choices=[*fuzzing.KINDS], metavar="KIND")
    parser.add_argument("--keep", type=Path, help="folder for inputs that failed")
    given = parser.parse_args()
    heads = "".join(f"{each:>17}" for each in (SAME, REFUSED, OTHER, *FAILURES))
    sys.stdout.write(f"{'kind':<22}{'cases':>8}{heads}\n")
    with tempfile.TemporaryDirectory() as folder:
        outcomes, failures = run_kinds(given.kinds, given.count, given.seconds, Path(folder))
    sys.stdout.write(line("all", outcomes))
    for case, outcome, told in failures[:20]:
        sys.stdout.write(f"{case.kind} {case.number} ({case.name}): {outcome}: {told}\n")
    if given.keep is not None:
        keep(failures, given.keep)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
