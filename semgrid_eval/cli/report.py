"""`semgrid-eval report`: the page, tables and figures of a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from semgrid_eval.cli.console import complain, loudness_options, progress, say

if TYPE_CHECKING:
    from semgrid_eval.report.estimates.gate import Limit


_FAIL_BELOW = (
    "As 'vehicles: -0.01': exit code 1 where a row of the second of two RUNs is clearly below by more than this."
)
_ROW = "Hold this row alone to --fail-below, or rows like 'BL-*', or NAME=OTHER; may be repeated."


@click.command("report", epilog="Example: semgrid-eval report runs/first")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder to write; `report` in RUN by default, but several need one."
)
@click.option(
    "--resample",
    type=click.Choice(["recordings", "groups"]),
    default="recordings",
    show_default=True,
    help="What intervals resample first: recordings, or the towns, cities or drives that they belong to.",
)
@click.option("--fail-below", "limits", metavar="COLUMN:DIFFERENCE", multiple=True, help=_FAIL_BELOW)
@click.option("--row", "rows", multiple=True, help=_ROW)
@loudness_options
def command(
    runs: tuple[Path, ...],
    out: Path | None,
    resample: Literal["recordings", "groups"],
    limits: tuple[str, ...],
    rows: tuple[str, ...],
) -> int:
    """Write one self-contained HTML page, CSV tables and figures from what RUN left on disk.

    Prints the path of the page. Rows of several runs stand in one verdict where their targets match; where they do not,
    the page says why. Files of RUN that are damaged or lost are named, here and on the page, and the exit code is then
    1.

    --fail-below makes a gate of two runs, an earlier and a later one. Rows are paired by name; the difference of their
    IoU is taken recording by recording, and a limit fails where the whole interval lies below it. It may be repeated,
    with classes (road), categories (vehicles), the run's own ones, and their mean (mean_known). Rows with other targets
    are refused.
    """
    from semgrid_eval.report.estimates.gate import columns_of, parse_limit
    from semgrid_eval.report.page.write import write_report  # here, so that `--help` does not wait for matplotlib

    if limits and len(runs) != 2:
        raise click.UsageError("--fail-below compares two runs, an earlier and a later one")
    if rows and not limits:
        raise click.UsageError("--row says what --fail-below compares")
    columns = columns_of(runs[0]) if limits else ()
    kept = [parse_limit(each, columns) for each in limits]
    damages = list[str]()
    with progress("reading results") as shown:
        page = write_report(runs, out, resample=resample, progress=shown, damaged=damages.append)
    for damage in damages:
        complain(f"Error: {damage}")
    click.echo(page)
    holds = _hold(runs[0], runs[1], kept, rows, resample) if kept else True
    return 1 if damages or not holds else 0


def _hold(
    before: Path, after: Path, limits: "Sequence[Limit]", rows: Sequence[str], level: Literal["recordings", "groups"]
) -> bool:
    """Say of each row and limit whether it holds, and return whether all do."""
    from semgrid_eval.report.estimates.gate import check_gate

    with progress("gate") as shown:
        gate = check_gate((before, after), limits, rows=rows, level=level, progress=shown)
    for name in gate.missing:
        complain(f"Warning: row {name} of {before} is not in {after}: it is not compared")
    for verdict in gate.verdicts:
        say(f"gate: {verdict}") if verdict.holds else complain(f"Error: gate: {verdict}")
    return gate.holds
