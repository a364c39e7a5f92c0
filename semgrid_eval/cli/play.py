"""`semgrid-eval play`: the windows of a row as an MCAP log for viewers."""

from pathlib import Path

import click

from semgrid_eval.cli.console import loudness_options, progress, say

_TRAININGS = "Trained networks of the run.  [default: RUN/trainings]"


@click.command("play", epilog="Example: semgrid-eval play runs/first BL-DC --out play.mcap --logs logs")
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("rows", metavar="ROW...", nargs=-1, required=True)
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="The MCAP file to write.")
@click.option("--logs", type=click.Path(path_type=Path), help="The run's logs: adds pictures and every target.")
@click.option("--recording", help="The recording to play.  [default: the first]")
@click.option("--all", "every_recording", is_flag=True, help="Play all recordings, one after the other.")
@click.option("--stream", "live", is_flag=True, help="Play streams as a viewer would have seen them live.")
@click.option("--trainings", type=click.Path(path_type=Path), help=_TRAININGS)
@click.option("--grids", type=click.Path(path_type=Path), help="Grid cache of the run.  [default: RUN/grids]")
@click.option("--force", is_flag=True, help="Replace --out and the layout beside it, whatever they are.")
@loudness_options
def command(
    run: Path,
    rows: tuple[str, ...],
    out: Path,
    logs: Path | None,
    recording: str | None,
    trainings: Path | None,
    grids: Path | None,
    *,
    every_recording: bool,
    live: bool,
    force: bool,
) -> None:
    """Write what each ROW of a run predicted as an MCAP log, beside target, mask and inputs.

    Grids are foxglove.Grid messages, which Foxglove and Lichtblick draw; beside them, as pictures under /picture for
    viewers that draw no grids, and under /exact the class ids as they are scored. Rows have numbers instead of names in
    topics, from 1 in the order given, so that the layout that is written beside the log serves all rows.

    With --logs, every target that a recording has is predicted again: networks take the weights that the run has kept,
    what learns without gradients learns again. Windows that were scored stay as they were scored. Without --logs, and
    for models of your own, there are these alone.

    Their log time is the target's time, their publish time that of the last input. Inputs are moved to the target's
    time, also those of a row without translation, whose model saw them not moved. With --all, recordings follow each
    other a second apart: the first keeps its times, those of the others are shifted.

    With --stream, of rows with `stream:`, log times are those at which a viewer would have seen the grids of the one
    recording that such a row keeps: answers when they are published and again at each time of evaluation, where the row
    says that they lie then, targets at their capture. The exact message of each answer has the time that it is for and
    the capture of its newest input.

    An earlier log of this command is replaced, with its layout unless that was changed; nothing else is. Prints the
    path of the log.
    """
    from semgrid_eval.playback.write import Play, write_playback

    if every_recording and recording is not None:
        raise click.UsageError("--recording names one recording, --all plays all of them")
    if every_recording and live:
        raise click.UsageError("--stream plays the one recording that a run keeps, and --all all of them")
    play = Play(run, rows, logs, trainings, grids, recording, every_recording, live)
    with progress("play") as shown:
        written = write_playback(play, out, force=force, progress=shown)
    for note in written.notes:
        say(note)
    say(f"layout for Foxglove or Lichtblick: {written.layout}")
    click.echo(written.log)
