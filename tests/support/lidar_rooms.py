"""Walls on a road, for a LiDAR to measure."""

import numpy as np

from semgrid_eval.recording.lidar import Mount
from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town.ground import Ground, Surface
from semgrid_eval.sources.town.sensors import RayCaster
from semgrid_eval.sources.town.solids import BOX, Soup, Texture, box, soup_of_boxes
from semgrid_eval.sources.town.stage import Scenery

MOUNT = Mount((0.95, 0.0, 1.73), (0.0, 0.0, 0.0, 1.0))
GROUND = Ground(np.full((2000, 2000), Surface.ROAD, np.uint8), -200.0, -200.0)


def empty() -> Soup:
    """Nothing but the road."""
    return soup_of_boxes(np.empty(0, BOX))


def wall(x_m, y_m, yaw_rad, label, texture=Texture.PLAIN, colour=(230, 230, 230)) -> Soup:
    """Stand a wall across the way to a place; it is a metre thick, 20 m wide and 8 m high."""
    look = (label, int(texture), colour)
    return soup_of_boxes(np.array([box((x_m, y_m, yaw_rad), (0.0, 8.0), (1.0, 20.0), look)], BOX))


def scenery(soup: Soup, pose: Pose) -> Scenery:
    """Show a soup from a pose of the vehicle."""
    return Scenery(pose, soup, soup, (RayCaster(soup.triangles_m),), GROUND, (0.0, 0.0))
