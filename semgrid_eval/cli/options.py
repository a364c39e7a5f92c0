"""Options of commands: from the fields of a configuration, and those that say where the work is done."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

import click
from pydantic.fields import FieldInfo

from semgrid_eval.apart import Limits
from semgrid_eval.config import Config
from semgrid_eval.executors import Executor, available_cores, local_executor
from semgrid_eval.ray_executor import LOCAL, RayExecutor

FOLDER = click.Path(path_type=Path, file_okay=False)
THERE = click.Path(path_type=Path, exists=True)
WORKERS = click.IntRange(1, 256)
Command = TypeVar("Command", bound=Callable[..., Any])
device_option = click.option("--device", default="auto", show_default=True, help="auto, cpu, cuda or cuda:N.")


def parameters_of(config: type[Config]) -> Iterator[click.Parameter]:
    """Make an option for each field of a configuration, and an argument for a path, or paths, without default.

    Fields are numbers, words, paths, flags, `Literal` of words, tuples of a fixed length of such, or of any length
    (`tuple[str, ...]`: the option may be given several times). Limits are for the configuration to check.
    """
    for name, field in config.model_fields.items():
        kind = _plain(field.annotation)
        if kind is Path and field.is_required():
            yield click.Argument([name], type=THERE)
        elif kind == tuple[Path, ...] and field.is_required():
            yield click.Argument([name], type=THERE, nargs=-1, required=True)
        else:
            yield click.Option([f"--{name.replace('_', '-')}", name], **_settings(kind, field))


def _settings(kind: Any, field: FieldInfo) -> dict[str, Any]:  # noqa: ANN401 - a type
    settings = {"help": field.description, "required": field.is_required()}
    if kind is bool:
        return {**settings, "is_flag": True}
    if not field.is_required() and field.default is not None:
        settings |= {"default": field.default, "show_default": field.default != ()}
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        many = {"multiple": True} if Ellipsis in others else {"nargs": 1 + len(others)}
        return {**settings, **many, "type": _value_type(_plain(first))}
    return {**settings, "type": _value_type(kind)}


def _value_type(kind: Any) -> Any:  # noqa: ANN401 - types
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    return click.Path(path_type=Path, exists=True) if kind is Path else kind


def _plain(annotation: Any) -> Any:  # noqa: ANN401 - a type annotation
    """Take a type out of `Annotated` and `... | None`."""
    if get_origin(annotation) is Annotated:
        return _plain(get_args(annotation)[0])
    choices = [each for each in get_args(annotation) if each is not NoneType]
    return _plain(choices[0]) if NoneType in get_args(annotation) and len(choices) == 1 else annotation


def workers_option(text: str) -> Callable[[Command], Command]:
    """Return the option --workers, which is all cores unless given."""
    return click.option("--workers", type=WORKERS, default=available_cores(), show_default="all cores", help=text)


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
        type=click.FloatRange(0, min_open=True),
        default=Limits.time_s,
        show_default=True,
        help="Seconds in which code of your own, apart, has to give a sign: an update, a batch, the end of its `fit`.",
    )
    memory = click.option(
        "--memory-limit",
        type=click.FloatRange(0, min_open=True),
        show_default="7/8 of the machine's",
        help="GiB that code of your own, apart, may use.",
    )
    return apart(time(memory(command)))


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
