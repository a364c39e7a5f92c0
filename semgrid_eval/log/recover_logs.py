"""Recover several logs and folders of logs into a folder of their own."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.log.recover import recover_log
from semgrid_eval.log.recovery import Recovery
from semgrid_eval.log.store import find_logs
from semgrid_eval.places import remove_stale
from semgrid_eval.progress import Progress


@dataclass(frozen=True)
class Outcome:
    """What became of one log; without a recovery, nothing could be saved, and `failure` says why."""

    path: Path
    out: Path
    recovery: Recovery | None
    failure: str = ""

    def lines(self) -> Iterator[str]:
        """Say it in lines."""
        if self.recovery is None:
            yield f"not recovered: {self.failure}"
        else:
            yield from self.recovery.lines()

    def to_json(self) -> dict[str, object]:
        """Return it as `check.schema.json` describes it."""
        told = None if self.recovery is None else self.recovery.to_json()
        return {"log": str(self.path), "failure": self.failure, "recovery": told}


def targets(logs: Sequence[Path], out: Path) -> dict[Path, Path]:
    """Say where logs are recovered to: OUT/NAME, those of a folder by their place in it.

    Raises:
        InputError: two logs would have one place, something is there, or a folder holds no log.
    """
    found: dict[Path, Path] = {}
    for path, place in _placed(logs):
        target = out / place
        if path in found:
            continue
        if target in found.values():
            raise InputError("two logs have this name; recover them into folders of their own", path=target)
        if target.exists() or target.is_symlink():
            raise InputError("is there already, and nothing is overwritten", path=target)
        found[path] = target
    return found


def recover_logs(found: Mapping[Path, Path], progress: Progress) -> Iterator[Outcome]:
    """Recover each log to its target; one that cannot be read or written is told, and the others go on."""
    for folder in {target.parent for target in found.values()}:
        remove_stale(folder)
    for done, (path, target) in enumerate(found.items(), start=1):
        try:
            yield Outcome(path, target, recover_log(path, target))
        except InputError as error:
            yield Outcome(path, target, None, str(error).removeprefix(f"{path}: "))
        progress(done, len(found), path.name)


def _placed(logs: Sequence[Path]) -> Iterator[tuple[Path, Path]]:
    for given in logs:
        if given.is_dir():
            yield from ((path, path.relative_to(given)) for path in find_logs(given))
        else:
            yield given, Path(given.name)
