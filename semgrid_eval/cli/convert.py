"""`semgrid-eval convert`: bring recordings into the form of logs."""

import importlib
from pathlib import Path

import click

from semgrid_eval.cli.console import progress, say
from semgrid_eval.cli.work import chosen_executor, executor_options, workers_option
from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.log.convert import ConversionJob, ConversionSummary, convert_recordings
from semgrid_eval.log.store import find_logs, label_of
from semgrid_eval.sources.cityscapes.tree import CAMERA_NAME, find_sequences

_EXTRA_SOURCES = {"synthetic": "semgrid_eval.cli.convert_synthetic"}


class _Sources(click.Group):
    """Imports the command of a source that needs an extra only when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*super().list_commands(ctx), *_EXTRA_SOURCES]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _EXTRA_SOURCES:
            return super().get_command(ctx, cmd_name)
        try:
            found = getattr(importlib.import_module(_EXTRA_SOURCES[cmd_name]), cmd_name)
        except ModuleNotFoundError as error:
            return _not_installed(cmd_name, error.name or "a package")
        assert isinstance(found, click.Command)
        return found


def _not_installed(extra: str, package: str) -> click.Command:
    """Stand in for a command whose packages are missing, so that the help of the others still works."""

    def refuse() -> None:
        raise MissingExtraError(extra, package)

    settings = {"ignore_unknown_options": True, "allow_extra_args": True}
    return click.Command(
        extra,
        callback=refuse,
        short_help=f"(needs the extra {extra!r})",
        add_help_option=False,
        context_settings=settings,
    )


def show(summary: ConversionSummary, out: Path, *, benchmark: bool = False) -> int:
    """Print what became of a conversion, of a benchmark or not, and return the exit code."""
    for label, reason in summary.failed.items():
        say(f"Error: {label}: {reason}")
    say(f"{out}: {len(summary.written)} written, {len(summary.skipped)} up to date, {len(summary.failed)} failed")
    others = _strays(out, summary, all_splits=benchmark)
    if others:
        whole = "the benchmark" if benchmark else "this conversion"
        say(f"Warning: {out} holds {len(others)} logs that do not belong to {whole}, such as {others[0]}")
    return 1 if summary.failed else 0


def _strays(out: Path, summary: ConversionSummary, *, all_splits: bool) -> list[Path]:
    """Return the logs that a conversion neither wrote nor found there.

    Unless it is for all splits, those of other splits do not count: each may be converted by a command of its own.
    """
    known = {*summary.written, *summary.skipped, *summary.failed}
    splits = {label.split("/")[0] for label in known}
    try:
        logs = find_logs(out)
    except InputError:  # every recording failed
        return []
    others = [log for log in logs if label_of(log, out) not in known]
    return [log for log in others if all_splits or label_of(log, out).split("/")[0] in splits]


@click.group("convert", cls=_Sources)
def command() -> None:
    """Convert recordings to MCAP logs, one log a recording."""


@command.command(
    "cityscapes", epilog="Example: semgrid-eval convert cityscapes cityscapes logs --labels predictions --split val"
)
@click.argument("src", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.argument("out", type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--labels",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Folder of label images whose names begin with the frame's, anywhere below it; else gtFine is used.",
)
@click.option("--train-ids", is_flag=True, help="Label images hold train ids instead of label ids.")
@click.option("--split", "splits", multiple=True, help="Only this split; may be given several times.")
@workers_option("Logs at once.")
@executor_options
@click.option("--camera-name", default=CAMERA_NAME, show_default=True, help="Name of the camera in the logs.")
def cityscapes(
    src: Path,
    out: Path,
    labels: Path | None,
    splits: tuple[str, ...],
    workers: int,
    executor: str,
    address: str,
    camera_name: str,
    *,
    train_ids: bool,
) -> int:
    """Convert the Cityscapes sequence tree SRC to logs OUT/<split>/<city>_<sequence>_<first frame>.mcap.

    SRC holds leftImg8bit_sequence, disparity_sequence, vehicle_sequence, timestamp_sequence and camera (for each frame
    or one of a sequence). Where frame numbers break off inside a stretch of 30 a frame is lost, elsewhere another log
    begins.

    A recording fails as a whole, named with the file at fault, if a frame is lost, a file is missing, broken or
    impossible, camera files differ, time stamps do not grow, or a picture has another size or bit depth: windows count
    frames, so none may be dropped. Frames without a label image are no fault. The other recordings are converted; the
    exit code is then 1. Logs whose inputs have not changed are left as they are.
    """
    sequences = find_sequences(src, splits=splits, labels=labels, train_ids=train_ids, camera_name=camera_name)
    jobs = [ConversionJob(name=s.name, split=s.split, digest=s.digest, load=s.recording) for s in sequences]
    work_on = chosen_executor(executor, address, workers)
    with progress("convert") as watch:
        summary = convert_recordings(jobs, out, executor=work_on, progress=watch)
    return show(summary, out)
