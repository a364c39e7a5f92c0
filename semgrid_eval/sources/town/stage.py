"""A town around the places where a recording passes: who is there at a time, and what can be seen of it all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town.bodies import boxes_of
from semgrid_eval.sources.town.ground import Ground
from semgrid_eval.sources.town.sensors import Eye, RayCaster, View, look
from semgrid_eval.sources.town.solids import Soup, soup_of_boxes
from semgrid_eval.sources.town.town import Town
from semgrid_eval.sources.town.traffic import Snapshot

_SIGHT_M = 160.0
_BEHIND_M, _ASIDE_M = 9.0, 9.0  # includes what throws shadows into the picture


@dataclass(frozen=True)
class Scenery:
    """All that rays can meet at one time, in the frame of the stage."""

    pose: Pose  # of the vehicle, in the map frame
    soup: Soup  # what stands still, then the movers
    movers: Soup
    casters: tuple[RayCaster, ...]  # of the soup
    ground: Ground
    place_m: tuple[float, float]  # the stage's origin in the map frame

    def seen_by(self, eye: Eye) -> View:
        """Return what an eye on the vehicle sees."""
        return look(eye, self.pose, self.casters, self.soup, self.ground, self.place_m)


class Stage:
    """A town around the places where a recording passes; what stands still is prepared once.

    Its frame is the map frame with the origin moved to the first place.
    """

    def __init__(self, town: Town, places_m: Sequence[tuple[float, float]]) -> None:
        self._place_m = places_m[0]
        self._ground = town.scene.ground
        self._traffic = town.traffic
        corners = town.scene.soup.triangles_m[:, 0, :2]
        near = [np.linalg.norm(corners - np.array(place, np.float32), axis=1) < _SIGHT_M for place in places_m]
        self.still = town.scene.soup.where(np.any(near, axis=0)).moved(-self._place_m[0], -self._place_m[1])
        self._still_caster = RayCaster(self.still.triangles_m)
        self.parked = town.scene.parked.where(np.any([_is_near(town.scene.parked, *at) for at in places_m], axis=0))

    def others(self, time_s: float, pose: Pose, ego: int) -> Snapshot:
        """Return the road users near the ego vehicle, itself left out."""
        moving = self._traffic.at(time_s)
        return moving.where(_is_near(moving, pose.x_m, pose.y_m) & (moving.actor != ego))

    def scenery(self, shown: Snapshot, time_s: float, pose: Pose) -> Scenery:
        """Return what can be seen at a time and a pose of the vehicle, of road users those that are `shown`."""
        movers = soup_of_boxes(boxes_of(shown, time_s)).moved(-self._place_m[0], -self._place_m[1])
        casters = (self._still_caster, RayCaster(movers.triangles_m))
        return Scenery(pose, Soup.joined([self.still, movers]), movers, casters, self._ground, self._place_m)


def in_sight(actors: Snapshot, pose: Pose, widening: float) -> Snapshot:
    """Return the actors that may be seen ahead or throw a shadow that is seen.

    They are up to `widening` metres aside for each metre ahead.
    """
    away = actors.centre_m - (pose.x_m, pose.y_m)
    ahead_m = away @ (np.cos(pose.yaw_rad), np.sin(pose.yaw_rad))
    left_m = away @ (-np.sin(pose.yaw_rad), np.cos(pose.yaw_rad))
    return actors.where((ahead_m > -_BEHIND_M) & (np.abs(left_m) < _ASIDE_M + widening * np.maximum(ahead_m, 0.0)))


def _is_near(actors: Snapshot, x_m: float, y_m: float) -> NDArray[np.bool_]:
    return np.asarray(np.linalg.norm(actors.centre_m - (x_m, y_m), axis=1) < _SIGHT_M)
