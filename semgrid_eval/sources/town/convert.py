"""The simulated town as logs."""

from functools import partial
from pathlib import Path

from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs
from semgrid_eval.sources.source import Source
from semgrid_eval.sources.town.recordings import SyntheticConfig, plan_recordings
from semgrid_eval.sources.town.rendering import render_recording

CACHE = ".towns"
KEPT = f"Folder of towns.  [default: OUT/{CACHE}]"
_HELP = """Simulate towns and drive through them: logs OUT/<split>/town<NN>_<recording>_000000.mcap.

Traffic comes from Eclipse SUMO, pictures from ray casting with Embree; exact labels, disparity, instances, the pose
and all road users with their velocities are on topics of their own. Training and validation have different towns.
Logs that are up to date are left as they are, so that the same command goes on after a stop.
"""


def convert_town(
    config: SyntheticConfig, out: Path, work: Work = IN_PROCESS, *, dataset: str = "synthetic"
) -> ConversionSummary:
    """Simulate towns, draw recordings from them and write their logs; what is there already is kept.

    Towns are kept in the cache of `work`; the logs carry the name `dataset`.

    Raises:
        InputError: SUMO failed, or a folder cannot be written to.
        MissingExtraError: SUMO or Embree is not installed.
    """
    with work.stage("simulate") as progress:
        cache = work.cache or out / CACHE
        plans = plan_recordings(config, cache, progress, workers=work.workers, dataset=dataset)
    jobs = [ConversionJob(plan.name, plan.split, plan.digest, partial(render_recording, plan)) for plan in plans]
    return convert_jobs(jobs, out, work, label="render")


SOURCE = Source(
    options=SyntheticConfig,
    convert=convert_town,
    help=_HELP,
    example="semgrid-eval convert synthetic logs --recordings 2 --towns 2 --town-size-m 250 --duration-s 15",
    cache=KEPT,
)
