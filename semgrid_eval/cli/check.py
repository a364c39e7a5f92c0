"""`semgrid-eval check`: is a log whole and plausible?"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from semgrid_eval.cli.console import progress, say
from semgrid_eval.errors import printable

if TYPE_CHECKING:
    from semgrid_eval.log.check import LogReport


@click.command("check", epilog="Example: semgrid-eval check logs")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True))
@click.option("--strict", is_flag=True, help="Refuse warnings, too: a log without checksums, for one.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def command(logs: tuple[Path, ...], *, strict: bool, as_json: bool) -> int:
    """Check logs: every LOG that is a file, and all logs below every LOG that is a folder.

    Looks at all checksums, channels, counts and time stamps (repeated, gaps, jitter), at the plausibility of
    calibration and motion, and decodes every label and disparity image. One line a finding; the exit code is 1 if any
    is an error, and with --strict if there is any.
    """
    from semgrid_eval.log.check import check_log
    from semgrid_eval.log.store import find_logs

    paths = [path for given in logs for path in (find_logs(given) if given.is_dir() else [given])]
    reports: list[LogReport] = []
    with progress("check") as watch:
        for path in paths:
            reports.append(check_log(path))
            watch(len(reports), len(paths), path.name)
    if as_json:
        click.echo(json.dumps([_as_json(report) for report in reports], indent=2))
    else:
        for report in reports:
            for finding in report.findings:
                click.echo(printable(f"{report.path}: {finding}"))
    bad = sum(not report.good or (strict and bool(report.findings)) for report in reports)
    say(f"{len(reports)} logs checked, {bad} with errors{' or warnings' if strict else ''}")
    return 1 if bad else 0


def _as_json(report: "LogReport") -> dict[str, object]:
    return {
        "log": str(report.path),
        "good": report.good,
        "duration_s": report.duration_s,
        "messages": report.counts,
        "conditions": {name: each._asdict() for name, each in report.conditions.items()},
        "findings": [asdict(finding) for finding in report.findings],
    }
