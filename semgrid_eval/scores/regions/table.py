"""The partitions of cells that every metric is counted by."""

import numpy as np

from semgrid_eval.scores.metrics.metric import Partition
from semgrid_eval.scores.regions.actors import ACTORS
from semgrid_eval.scores.regions.distance import DISTANCE
from semgrid_eval.scores.regions.origin import ORIGIN

EVERYWHERE = Partition("all", ("all",), "", lambda scored: np.zeros(scored.target.shape, np.int64))
PARTITIONS: dict[str, Partition] = {each.name: each for each in (EVERYWHERE, ACTORS, DISTANCE, ORIGIN)}
"""To add a partition, add a line here."""
