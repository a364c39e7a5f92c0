"""Options that say where the work of a command is done: in processes of this machine, or on a Ray cluster."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click

from semgrid_eval.executors import Executor, available_cores, local_executor
from semgrid_eval.ray_executor import LOCAL, RayExecutor

Command = TypeVar("Command", bound=Callable[..., Any])


def workers_option(text: str) -> Callable[[Command], Command]:
    """Return the option --workers, which is all cores unless given."""
    kind = click.IntRange(1, 256)
    return click.option("--workers", type=kind, default=available_cores(), show_default="all cores", help=text)


device_option = click.option("--device", default="auto", show_default=True, help="auto, cpu, cuda or cuda:N.")


def executor_options(command: Command) -> Command:
    """Add --executor and --address, in this order, to a command."""
    address = click.option(
        "--address", default=LOCAL, show_default=True, help="Of a running Ray cluster; 'local' starts one here."
    )
    executor = click.option("--executor", type=click.Choice([LOCAL, "ray"]), default=LOCAL, show_default=True)
    return executor(address(command))


def chosen_executor(
    name: str, address: str, workers: int, *, gpus: float = 0.0, shared: Sequence[str] = ()
) -> Executor:
    """Make the executor that options ask for, `local` or `ray`.

    `gpus` are for each piece of work on Ray, `shared` the GPUs that local processes share, as CUDA names them.

    Raises:
        MissingExtraError: Ray is asked for and not installed.
        InputError: the cluster cannot be reached, or never has what a piece of work asks for.
    """
    if name == LOCAL:
        return local_executor(workers, gpus=shared)
    return RayExecutor(address, gpus=gpus, local_cpus=workers if address == LOCAL else None)
