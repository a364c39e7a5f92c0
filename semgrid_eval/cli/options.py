"""Options of several commands, most of which say where the work is done."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from semgrid_eval.cli.console import Command
from semgrid_eval.cli.types import Number, Whole
from semgrid_eval.workplace import LOCAL, Limits

if TYPE_CHECKING:
    from semgrid_eval.executors import Executor

FOLDER = click.Path(path_type=Path, file_okay=False)
THERE = click.Path(path_type=Path, exists=True)
FILE_THERE = click.Path(path_type=Path, exists=True, dir_okay=False)
FOLDER_THERE = click.Path(path_type=Path, exists=True, file_okay=False)
WORKERS = Whole(1, 256)


class _Pattern(click.Path):
    """A path that exists, or a pattern such as 'logs/*.mcap' where no shell has put names in its place."""

    def convert(  # type: ignore[override] # several paths for one word
        self, value: "str | os.PathLike[str]", param: click.Parameter | None, ctx: click.Context | None
    ) -> list[Path]:
        from glob import glob

        pattern = os.fspath(value)
        if not any(sign in pattern for sign in "*?[") or Path(pattern).exists():
            super().convert(value, param, ctx)
            return [Path(pattern)]
        found = sorted(map(Path, glob(pattern, recursive=True)))  # noqa: PTH207 - absolute patterns, too
        if not found:
            self.fail(f"Nothing matches {pattern!r}.", param, ctx)
        return found


def logs_argument() -> click.Argument:
    """Make the argument LOG...: logs, folders of logs and patterns of either, all of which exist."""

    def flat(ctx: click.Context, option: click.Parameter, given: Sequence[Sequence[Path]]) -> tuple[Path, ...]:
        return tuple(dict.fromkeys(path for each in given for path in each))

    return click.Argument(
        ["logs"], metavar="LOG...", nargs=-1, required=True, type=_Pattern(exists=True), callback=flat
    )


device_option = click.option("--device", default="auto", show_default=True, help="auto, cpu, cuda or cuda:N.")


def _all_cores() -> int:
    from semgrid_eval.executors import available_cores

    return available_cores()


def workers_option(text: str) -> Callable[[Command], Command]:
    """Return the option --workers, which is all cores unless given."""
    return click.option("--workers", type=WORKERS, default=_all_cores, show_default="all cores", help=text)


def executor_options(command: Command) -> Command:
    """Add --executor and --address, in this order, to a command."""
    address = click.option(
        "--address", default=LOCAL, show_default=True, help="Address of a running Ray cluster; 'local' starts one here."
    )
    executor = click.option("--executor", type=click.Choice([LOCAL, "ray"]), default=LOCAL, show_default=True)
    return executor(address(command))


def own_model_options(command: Command) -> Command:
    """Add the options that say where models of one's own run, and what they may use."""
    apart = click.option(
        "--own-models",
        type=click.Choice(["apart", "here"]),
        default="apart",
        show_default=True,
        help="Run code of your own in a process apart, or in the run's own, where a debugger can follow it.",
    )
    time = click.option(
        "--time-limit",
        type=Number(0, min_open=True),
        default=Limits.time_s,
        show_default=True,
        help="Seconds in which code of your own, apart, has to give a sign: an update, a batch, the end of its `fit`.",
    )
    memory = click.option(
        "--memory-limit",
        type=Number(0, min_open=True),
        show_default="7/8 of the machine's",
        help="GiB that code of your own, apart, may use.",
    )
    return apart(time(memory(command)))


class Folders(NamedTuple):
    """What all machines of a cluster must reach under the same paths."""

    read: Sequence[Path]
    written: Path


def chosen_executor(
    name: str, address: str, workers: int, folders: Folders, *, gpus: float = 0.0, shared: Sequence[str] = ()
) -> "Executor":
    """Make the executor that options ask for, `local` or `ray`.

    `gpus` are for each piece of work on Ray, `shared` the GPUs that local processes share, as CUDA names them.

    Raises:
        MissingExtraError: Ray is asked for and not installed.
        InputError: the cluster cannot be reached, never has what a piece of work asks for, or does not share `folders`.
    """
    from semgrid_eval.executors import local_executor
    from semgrid_eval.ray_executor import RayExecutor

    if name == LOCAL:
        return local_executor(workers, gpus=shared)
    if address == LOCAL:
        return RayExecutor(gpus=gpus, local_cpus=workers)
    cluster = RayExecutor(address, gpus=gpus)
    cluster.check_shared(folders.read, folders.written)
    return cluster
