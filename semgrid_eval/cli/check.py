"""`semgrid-eval check`: is a log whole, and what it should be? Saves what is whole of one that is damaged."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from semgrid_eval.cli.console import loudness_options, progress, say
from semgrid_eval.cli.options import FILE_THERE, FOLDER, logs_argument, workers_option
from semgrid_eval.errors import printable
from semgrid_eval.words import plural

if TYPE_CHECKING:
    from semgrid_eval.log.findings import LogReport
    from semgrid_eval.log.recover_logs import Outcome

_UNREADABLE = 3
_FORMAT_VERSION = 1


def _print_spec(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from semgrid_eval.log.contract import contract_text
        from semgrid_eval.log.default_contract import default_contract

        click.echo(contract_text(default_contract()), nl=False)
        ctx.exit()


@click.command("check", params=[logs_argument()], epilog="Example: semgrid-eval check logs")
@click.option("--recover", metavar="OUT", type=FOLDER, help="Save what is whole of every LOG in this folder.")
@click.option("--spec", metavar="FILE", type=FILE_THERE, help="What is expected of the recordings (YAML).")
@click.option(
    "--print-spec",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_spec,
    help="Print what is expected without --spec, and end.",
)
@click.option("--strict", is_flag=True, help="Refuse warnings, too: a log without checksums, for one.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@workers_option("Logs checked at once.")
@loudness_options
def command(
    logs: tuple[Path, ...], recover: Path | None, spec: Path | None, workers: int, *, strict: bool, as_json: bool
) -> int:
    """Check logs: every LOG that is a file, all logs below every LOG that is a folder; LOG may be a pattern in quotes.

    Looks at all checksums, decodes every label and disparity image, and compares channels, counts, times, calibration
    and motion with what is expected of a recording. One line a finding.

    With --recover, every message whose chunk's checksum holds is saved to a new log OUT/NAME, and attachments and
    metadata with it; a line tells each loss, and it is the new logs that are checked. A log that is whole is copied.

    The exit code is 0 if there is no error, 1 if there is one (with --strict: or a warning; with --recover: or a
    loss), and 3 if a log cannot be read to its end (with --recover: if nothing of it could be saved).
    """
    from semgrid_eval.executors import local_executor
    from semgrid_eval.log.check import check_logs
    from semgrid_eval.log.contract import load_contract

    contract = None if spec is None else load_contract(spec)
    outcomes = _recovered(logs, recover) if recover is not None else None
    paths = _found(logs) if outcomes is None else [each.out for each in outcomes if each.recovery is not None]
    with progress("check") as watch:
        reports = check_logs(paths, contract, local_executor(min(workers, len(paths))), watch)
    if as_json:
        told = [each.to_json() for each in outcomes or ()]
        value = {"format_version": _FORMAT_VERSION, "logs": [each.to_json() for each in reports], "recoveries": told}
        click.echo(json.dumps(value, indent=2, allow_nan=False))
    else:
        _show(reports, outcomes or ())
    return _judge(reports, outcomes or (), strict=strict)


def _found(logs: Sequence[Path]) -> list[Path]:
    from semgrid_eval.log.store import find_logs

    return [path for given in logs for path in (find_logs(given) if given.is_dir() else [given])]


def _recovered(logs: Sequence[Path], out: Path) -> "list[Outcome]":
    from semgrid_eval.log.recover_logs import recover_logs, targets

    found = targets(logs, out)
    with progress("recover") as watch:
        return list(recover_logs(found, watch))


def _show(reports: "Sequence[LogReport]", outcomes: "Sequence[Outcome]") -> None:
    for outcome in outcomes:
        for line in outcome.lines():
            click.echo(printable(f"{outcome.path}: {line}"))
    for report in reports:
        for finding in report.findings:
            click.echo(printable(f"{report.path}: {finding}"))
        if report.more:
            click.echo(printable(f"{report.path}: and {plural(report.more, 'more finding')}"))


def _judge(reports: "Sequence[LogReport]", outcomes: "Sequence[Outcome]", *, strict: bool) -> int:
    bad = sum(not report.good or (strict and bool(report.findings)) for report in reports)
    say(f"{plural(len(reports), 'log')} checked, {bad} with errors{' or warnings' if strict else ''}")
    unsaved = sum(each.recovery is None for each in outcomes)
    lossy = sum(each.recovery is not None and not each.recovery.lost_nothing for each in outcomes)
    if outcomes:
        say(
            f"{plural(len(outcomes) - unsaved, 'log')} saved, {lossy} of them with losses; {unsaved} could not be saved"
        )
    if unsaved or not all(report.is_readable for report in reports):
        return _UNREADABLE
    return 1 if bad or lossy else 0
