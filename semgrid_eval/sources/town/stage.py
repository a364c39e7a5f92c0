"""The part of a town that one recording can see, who is on it, and the pictures taken of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town.bodies import boxes_of
from semgrid_eval.sources.town.sensors import Camera, RayCaster, View, look
from semgrid_eval.sources.town.shading import Painter, Sunlight
from semgrid_eval.sources.town.solids import Soup, soup_of_boxes
from semgrid_eval.sources.town.town import Town
from semgrid_eval.sources.town.traffic import Snapshot

_SIGHT_M = 160.0
_BEHIND_M, _ASIDE_M, _WIDENING = 9.0, 9.0, 0.55  # includes what throws shadows into the picture


class Stage:
    """A town around the place where a recording begins; what stands still is prepared once.

    Its frame is the map frame with the origin moved to that place.
    """

    def __init__(self, town: Town, cameras: Sequence[Camera], sunlight: Sunlight, place_m: tuple[float, float]) -> None:
        self._place_m = place_m
        self._ground = town.scene.ground
        self._traffic = town.traffic
        corners = town.scene.soup.triangles_m[:, 0, :2]
        near = np.linalg.norm(corners - np.array(place_m, np.float32), axis=1) < _SIGHT_M
        self._still = town.scene.soup.where(near).moved(-place_m[0], -place_m[1])
        self._still_caster = RayCaster(self._still.triangles_m)
        self._painters = [(camera, Painter(camera, sunlight, self._still)) for camera in cameras]
        self.parked = town.scene.parked.where(_is_near(town.scene.parked, *place_m))

    def others(self, time_s: float, pose: Pose, ego: int) -> Snapshot:
        """Return the road users near the ego vehicle, itself left out."""
        moving = self._traffic.at(time_s)
        return moving.where(_is_near(moving, pose.x_m, pose.y_m) & (moving.actor != ego))

    def pictures(self, others: Snapshot, time_s: float, pose: Pose) -> list[tuple[View, NDArray[np.uint8]]]:
        """Return what each camera sees from a pose of the vehicle, and its colour image (H, W, 3)."""
        boxes = boxes_of(_in_sight(others, pose), time_s)
        movers = soup_of_boxes(boxes).moved(-self._place_m[0], -self._place_m[1])
        casters = (self._still_caster, RayCaster(movers.triangles_m))
        soup = Soup.joined([self._still, movers])
        pictures = []
        for camera, painter in self._painters:
            view = look(camera, pose, casters, soup, self._ground, self._place_m)
            pictures.append((view, painter.paint(view, casters, movers)))
        return pictures


def _is_near(actors: Snapshot, x_m: float, y_m: float) -> NDArray[np.bool_]:
    return np.asarray(np.linalg.norm(actors.centre_m - (x_m, y_m), axis=1) < _SIGHT_M)


def _in_sight(actors: Snapshot, pose: Pose) -> Snapshot:
    """Return the actors that may be seen or throw a shadow that is seen."""
    away = actors.centre_m - (pose.x_m, pose.y_m)
    ahead_m = away @ (np.cos(pose.yaw_rad), np.sin(pose.yaw_rad))
    left_m = away @ (-np.sin(pose.yaw_rad), np.cos(pose.yaw_rad))
    return actors.where((ahead_m > -_BEHIND_M) & (np.abs(left_m) < _ASIDE_M + _WIDENING * np.maximum(ahead_m, 0.0)))
