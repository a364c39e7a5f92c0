"""`semgrid-eval play`: the windows of a row as an MCAP log for viewers."""

from pathlib import Path

import click

from semgrid_eval.cli.console import loudness_options, progress, say


@click.command("play", epilog="Example: semgrid-eval play runs/first BL-DC --out play.mcap --logs logs")
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("row", metavar="ROW")
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="The MCAP file to write.")
@click.option("--logs", type=click.Path(path_type=Path), help="The run's logs: adds pictures and the vehicle's way.")
@click.option("--recording", help="The recording to play.  [default: the first]")
@click.option("--all", "every_recording", is_flag=True, help="Play all recordings, one after the other.")
@click.option("--stream", "live", is_flag=True, help="Play a stream as a viewer would have seen it live.")
@click.option("--force", is_flag=True, help="Replace --out and the layout beside it, whatever they are.")
@loudness_options
def command(
    run: Path,
    row: str,
    out: Path,
    logs: Path | None,
    recording: str | None,
    *,
    every_recording: bool,
    live: bool,
    force: bool,
) -> None:
    """Write target, prediction, certainty, mask and inputs of a ROW's scored windows as an MCAP log.

    Grids are foxglove.Grid messages, which Foxglove and Lichtblick draw, and beside them, under /exact, the class ids
    as they are scored. Their log time is the target's time, their publish time that of the last input. Inputs are moved
    to the target's time, also those of a row without translation, whose model saw them not moved. With --all,
    recordings follow each other a second apart: the first keeps its times, those of the others are shifted. A layout
    for the viewer is written beside the log.

    With --stream, of a row with `stream:`, log times are those at which a viewer would have seen the grids of the one
    recording that such a row keeps: answers when they are published and again at each time of evaluation, where the row
    says that they lie then, targets at their capture. The exact message of each answer has the time that it is for and
    the capture of its newest input.

    An earlier log of this command is replaced, with its layout unless that was changed; nothing else is. Prints the
    path of the log.
    """
    from semgrid_eval.playback.write import write_playback

    if every_recording and recording is not None:
        raise click.UsageError("--recording names one recording, --all plays all of them")
    if every_recording and live:
        raise click.UsageError("--stream plays the one recording that a run keeps, and --all all of them")
    with progress("play") as shown:
        written = write_playback(
            *(run, row, out),
            logs=logs,
            recording=recording,
            every_recording=every_recording,
            live=live,
            force=force,
            progress=shown,
        )
    say(f"layout for Foxglove or Lichtblick: {written.layout}")
    click.echo(written.log)
