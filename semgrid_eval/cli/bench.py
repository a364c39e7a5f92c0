"""`semgrid-eval bench`: how fast everything is here, beside limits, rivals and goals."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from semgrid_eval.cli.console import complain, loudness_options, progress, say

if TYPE_CHECKING:
    from semgrid_eval.bench.measurement import Measurement

_BUSY = 0.5  # load for each core above which speeds suffer
_SHOWN = ("processor", "cpu_cores", "torch_threads", "device", "gpu", "python", "torch", "numpy", "semgrid-eval")


@click.command("bench", epilog="Example: semgrid-eval bench --quick --only training,prediction")
@click.option(
    "--only", metavar="PART,...", help="Measure these parts alone; memory, report and demo are measured only so."
)
@click.option("--quick", is_flag=True, help="Once each, with less to do: the smallest network alone, for one.")
@click.option("--device", default="cpu", show_default=True, help="Device of networks: auto, cpu, cuda or cuda:N.")
@click.option(
    "--json", "json_file", type=click.Path(path_type=Path, dir_okay=False), help="Also write everything there."
)
@loudness_options
def command(only: str | None, device: str, json_file: Path | None, *, quick: bool) -> None:
    """Measure the speed of this machine: medians of three, some minutes on two cores.

    start: of a command; town: building a town and simulating its traffic; render: recordings of it; convert: a
    Cityscapes tree, against copying it; logs: writing, reading and checking one, against the MCAP library and decoding;
    grids: making them, against decoding; cells: projecting and drawing a frame, against plain NumPy; training: of
    networks, against a textbook's float32 loop and against the product of large matrices; prediction: with networks,
    against eager float32, and scoring, against Cityscapes' way. Goals stand beside the numbers.

    With --only: memory of a training on 30,000 recordings, whose grids take 14 GiB of the disk; report: of a run of 18
    rows, 20 repeats and 500 recordings; demo: from a simulated town to a page.
    """
    from semgrid_eval.bench.measurement import FULL, QUICK
    from semgrid_eval.bench.suite import USUAL, conditions, load, measure
    from semgrid_eval.executors import available_cores
    from semgrid_eval.files import write_json
    from semgrid_eval.models.device import choose_device

    parts = USUAL if only is None else [part.strip() for part in only.split(",")]
    chosen = choose_device(device)
    here = conditions(chosen)
    if load() > _BUSY * available_cores():
        complain(f"Warning: this machine has other work (load {here['load']}); measured speeds are lower than its own")
    with progress("measure") as watch:
        found = measure(parts, QUICK if quick else FULL, device=chosen, progress=watch)
    if json_file:
        told = [{"part": part, **asdict(row)} for part, rows in found.items() for row in rows]
        write_json(json_file, {"conditions": here, "quick": quick, "measurements": told})
    click.echo(", ".join(f"{name} {here[name]}" for name in _SHOWN if name in here))
    for part, rows in found.items():
        for row in rows:
            click.echo(f"{part:<11}{row.what:<52}{_number(row.value):>8} {row.unit:<15}{_verdict(row)}".rstrip())
    if chosen.type == "cpu":
        say("Not measured: a GPU (--device cuda); what one is held to is measured by tools/gpu_check.py.")


def _number(value: float) -> str:
    """Show three digits that count."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _verdict(row: "Measurement") -> str:
    return f"{row.goal}{': short of the goal' if row.is_short else ''}"
