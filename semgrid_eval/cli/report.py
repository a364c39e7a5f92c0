"""`semgrid-eval report`: the page, tables and figures of a run."""

from pathlib import Path
from typing import Literal

import click

from semgrid_eval.cli.console import progress, say


@click.command("report", epilog="Example: semgrid-eval report runs/first")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write; `report` in the first run by default.")
@click.option(
    "--resample",
    type=click.Choice(["recordings", "groups"]),
    default="recordings",
    show_default=True,
    help="What intervals resample first: recordings, or the towns, cities or drives that they belong to.",
)
def command(runs: tuple[Path, ...], out: Path | None, resample: Literal["recordings", "groups"]) -> int:
    """Write one self-contained HTML page, CSV tables and figures from what RUN left on disk.

    Prints the path of the page. Rows of several runs stand in one verdict where their targets match; where they do not,
    the page says why. Files of RUN that are damaged or lost are named, here and on the page, and the exit code is then
    1.
    """
    from semgrid_eval.report.page.write import write_report  # here, so that `--help` does not wait for matplotlib

    damages = list[str]()
    with progress("reading results") as shown:
        page = write_report(runs, out, resample=resample, progress=shown, damaged=damages.append)
    for damage in damages:
        say(f"Error: {damage}")
    click.echo(page)
    return 1 if damages else 0
