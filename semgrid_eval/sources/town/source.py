"""The simulated town as the command line offers it; light to import."""

from semgrid_eval.sources.known import Source, later
from semgrid_eval.sources.town.config import CACHE, NoOptions, SizeOptions, SyntheticConfig

_KEPT = f"Folder of towns.  [default: OUT/{CACHE}]"
_HELP = """Simulate towns and drive through them: logs OUT/<split>/town<NN>_<recording>_000000.mcap.

Traffic comes from Eclipse SUMO, pictures from ray casting with Embree; exact labels, disparity, instances, the pose
and all road users with their velocities are on topics of their own. Training and validation have different towns.
Logs that are up to date are left as they are, so the same command can be run again to continue.
"""
_TOWN_V1_HELP = """Make the frozen data set town-v1 of the simulated town, which is the same wherever processors agree.

It has 300 recordings for training and 120 for validation, or 2,975 and 500 with --size full. The last line says whether
every recording is the published one. Logs that are up to date are left as they are, so that the same command continues
after a stop.
"""
_TOWN_RIG_V1_HELP = """Make the frozen data set town-rig-v1 of the simulated town: four cameras and a LiDAR.

It has 60 recordings for training and 40 for validation, some 3 GB, from the towns of town-v1. The last line says
whether every recording is the published one. Logs that are up to date are left as they are, so that the same command
continues after a stop.
"""

SYNTHETIC = Source(
    options=SyntheticConfig,
    convert=later("semgrid_eval.sources.town.convert:convert_town", extra="synthetic"),
    help=_HELP,
    example="semgrid-eval convert synthetic logs --recordings 2 --towns 2 --town-size-m 250 --duration-s 15",
    cache=_KEPT,
)
TOWN_V1 = Source(
    options=SizeOptions,
    convert=later("semgrid_eval.sources.town.convert:convert_town_v1", extra="synthetic"),
    help=_TOWN_V1_HELP,
    example="semgrid-eval convert town-v1 logs --size small",
    cache=_KEPT,
)
TOWN_RIG_V1 = Source(
    options=NoOptions,
    convert=later("semgrid_eval.sources.town.convert:convert_town_rig_v1", extra="synthetic"),
    help=_TOWN_RIG_V1_HELP,
    example="semgrid-eval convert town-rig-v1 logs",
    cache=_KEPT,
)
