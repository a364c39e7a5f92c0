"""`semgrid-eval cache`: what grids and towns are kept, and which of them can go."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from semgrid_eval.cli.console import loudness_options, say
from semgrid_eval.cli.options import FOLDER, FOLDER_THERE
from semgrid_eval.cli.types import Number

if TYPE_CHECKING:
    from semgrid_eval.runs.caches import Kept

_RUN = "Keep what this run uses; may be repeated."
_DAYS = "Keep what was used within so many days."


@click.command("cache", epilog="Example: semgrid-eval cache runs/first logs")
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True, type=FOLDER_THERE)
@click.option("--list/--clean", "listed", default=True, help="List what is kept, or remove what nobody uses.")
@click.option("--run", "runs", multiple=True, type=FOLDER, help=_RUN)
@click.option("--older-than", "days", type=Number(0), metavar="DAYS", help=_DAYS)
@click.option("--yes", is_flag=True, help="Remove it; without this, --clean only says what would go.")
@loudness_options
def command(folders: tuple[Path, ...], runs: tuple[Path, ...], days: float | None, *, listed: bool, yes: bool) -> None:
    """List the grids and towns that FOLDERs keep, with sizes and days since their last use, and clean them up.

    FOLDER is a run (grids lie in RUN/grids), a folder of logs (towns lie in LOGS/.towns), or such a folder itself, as
    given to --grids and --cache. Nothing here is lost for good: a run makes grids again that it does not find, a
    conversion towns.

    --clean removes grids, and answers of the truth, that no --run uses, those not used for --older-than days, or with
    both options what is both. Towns go by age alone: converted logs need them no more. Not for caches at work.
    """
    import time

    from semgrid_eval.runs.caches import DAY_S, find_kept, remove, unused, uses_of

    if not listed and not runs and days is None:
        raise click.UsageError("--clean needs to know what stays: --run RUN or --older-than DAYS, or both")
    now_s = time.time()
    kept = [each for folder in folders for each in find_kept(folder)]
    kept = list({each.path.resolve(): each for each in kept}.values())
    older_than_s = None if days is None else days * DAY_S
    gone = unused(kept, uses_of(runs) if runs else None, older_than_s, now_s) if runs or days is not None else None
    if listed:
        for line in table(kept, gone, now_s):
            click.echo(line)
        return
    for each in gone or ():
        if yes:
            remove(each)
        click.echo(each.path)
    many = f"{len(gone or ())} of {len(kept)}, {_size(gone or ())}"
    say(f"removed: {many}" if yes else f"would be removed: {many}; --yes removes it")


def table(kept: "Sequence[Kept]", gone: "Sequence[Kept] | None", now_s: float) -> list[str]:
    """Sum up what is kept by folder and kind; `gone` is what nobody uses, None where that was not asked."""
    groups = dict.fromkeys((each.path.parent, each.kind) for each in kept)
    heads = ("folder", "kind", "number", "size", "days since use")
    lines = ["\t".join(heads if gone is None else (*heads, "unused", "size"))]
    for folder, kind in groups:
        mine = [each for each in kept if (each.path.parent, each.kind) == (folder, kind)]
        cells = [str(folder), kind, str(len(mine)), _size(mine), _days(mine, now_s)]
        if gone is not None:
            left = [each for each in mine if each in gone]
            cells += [str(len(left)), _size(left)]
        lines.append("\t".join(cells))
    return lines


def _size(kept: "Sequence[Kept]") -> str:
    return f"{sum(each.size_bytes for each in kept) / 1e6:.1f} MB"


def _days(kept: "Sequence[Kept]", now_s: float) -> str:
    from semgrid_eval.runs.caches import DAY_S

    ages = sorted((now_s - each.used_s) / DAY_S for each in kept)
    return f"{ages[0]:.1f} to {ages[-1]:.1f}"
