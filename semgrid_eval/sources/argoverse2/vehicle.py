"""Where Argoverse's vehicle frame is in ours."""

import numpy as np

from semgrid_eval.geometry import SE3

EGO_FROM_ARGOVERSE = SE3(np.eye(3), np.array([0.0, 0.0, 0.32]))
"""Argoverse's origin is the rear axle, ours the ground below: poses lie .32 m above the map's ground, as the median of
each of two logs, whose medians are 1 mm apart."""
