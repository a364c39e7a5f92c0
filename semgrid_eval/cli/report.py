"""`semgrid-eval report`: the page, tables and figures of a run."""

from pathlib import Path

import click

from semgrid_eval.cli.console import progress


@click.command("report", epilog="Example: semgrid-eval report runs/first")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write; `report` in the first run by default.")
def command(runs: tuple[Path, ...], out: Path | None) -> None:
    """Write one self-contained HTML page, CSV tables and figures from what RUN left on disk.

    Prints the path of the page. Several runs are shown side by side, with their differences.
    """
    from semgrid_eval.report.page.write import write_report  # here, so that `--help` does not wait for matplotlib

    with progress("reading results") as shown:
        page = write_report(runs, out, progress=shown)
    click.echo(page)
