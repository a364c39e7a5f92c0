"""Renders one recording frame by frame: who is on stage, what the cameras see, what the vehicle reports, the truth."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.files import digest_value
from semgrid_eval.recording.types import Actor, Moment, MotionSample, Pose, Recording
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town import drives
from semgrid_eval.sources.town.bodies import actor_ids, boxes_of, heights_m
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.sources.town.picture_errors import recording_streams
from semgrid_eval.sources.town.rig import Rig
from semgrid_eval.sources.town.sensors import Camera, RayCaster, View, look
from semgrid_eval.sources.town.shading import Painter, Sunlight, draw_sunlight
from semgrid_eval.sources.town.solids import Soup, soup_of_boxes
from semgrid_eval.sources.town.town import Town, load_town
from semgrid_eval.sources.town.traffic import ROAD_USERS, Snapshot
from semgrid_eval.sources.town.varied import Conditions, fixed_conditions

_SIGHT_M = 160.0
_APART_M = 40.0  # between two places around which the town is shown
_BEHIND_M, _ASIDE_M = 9.0, 9.0  # includes what throws shadows into the picture, likewise what follows
_WIDENING, _WIDENING_BEYOND = 0.55, 0.065  # aside for each metre ahead: at least, and beyond what a camera sees
CAMERA_NAME = "front"
RENDER_VERSION = 2
"""Counts changes to what a plan renders to; logs of another version are rendered again."""
STAMP_JITTER_S = 0.001
CONDITIONS = 4
"""Which child of a recording's generator draws its conditions; those before are for what follows in `_moments`."""


class Stage:
    """A town around the places where a recording passes; what stands still is prepared once.

    Its frame is the map frame with the origin moved to the first place.
    """

    def __init__(
        self,
        town: Town,
        cameras: Sequence[Camera],
        sunlight: Sunlight,
        places_m: Sequence[tuple[float, float]],
        widening: float = _WIDENING,
    ) -> None:
        """Prepare places; road users are shown up to `widening` metres aside for each metre ahead."""
        self._place_m, self._widening = places_m[0], widening
        self._ground = town.scene.ground
        self._traffic = town.traffic
        corners = town.scene.soup.triangles_m[:, 0, :2]
        near = [np.linalg.norm(corners - np.array(place, np.float32), axis=1) < _SIGHT_M for place in places_m]
        self._still = town.scene.soup.where(np.any(near, axis=0)).moved(-self._place_m[0], -self._place_m[1])
        self._still_caster = RayCaster(self._still.triangles_m)
        self._painters = [(camera, Painter(camera, sunlight, self._still)) for camera in cameras]
        self.parked = town.scene.parked.where(np.any([_is_near(town.scene.parked, *at) for at in places_m], axis=0))

    def others(self, time_s: float, pose: Pose, ego: int) -> Snapshot:
        """Return the road users near the ego vehicle, itself left out."""
        moving = self._traffic.at(time_s)
        return moving.where(_is_near(moving, pose.x_m, pose.y_m) & (moving.actor != ego))

    def pictures(self, others: Snapshot, time_s: float, pose: Pose) -> list[tuple[View, NDArray[np.uint8]]]:
        """Return what each camera sees from a pose of the vehicle, and its colour image (H, W, 3)."""
        boxes = boxes_of(in_sight(others, pose, self._widening), time_s)
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


def in_sight(actors: Snapshot, pose: Pose, widening: float) -> Snapshot:
    """Return the actors that may be seen or throw a shadow that is seen."""
    away = actors.centre_m - (pose.x_m, pose.y_m)
    ahead_m = away @ (np.cos(pose.yaw_rad), np.sin(pose.yaw_rad))
    left_m = away @ (-np.sin(pose.yaw_rad), np.cos(pose.yaw_rad))
    return actors.where((ahead_m > -_BEHIND_M) & (np.abs(left_m) < _ASIDE_M + widening * np.maximum(ahead_m, 0.0)))


@dataclass(frozen=True)
class RecordingPlan:
    """Everything that determines a recording; small, and cheap to send to another process."""

    name: str  # of the recording
    split: str  # `train` or `val`
    town: Path  # folder of the town
    town_digest: str  # of the town's specification
    drive: drives.Drive  # which car, from when
    seed: tuple[int, ...]  # of the recording's random numbers
    width_px: int  # of the images
    height_px: int  # of the images
    stereo: Stereo  # `modelled`, `matched`, or `exact` for perfect labels, disparity and motion
    dataset: str = "synthetic"  # named in the log
    drawn: Conditions | None = None  # where recordings vary; else the camera is Cityscapes' and errors are the usual

    @property
    def digest(self) -> str:
        """Digest of everything that determines the content."""
        return digest_value({"plan": self.description(), "version": RENDER_VERSION})

    @property
    def conditions(self) -> Conditions:
        """The camera, and how strong errors are."""
        return self.drawn or fixed_conditions(self.width_px, self.height_px)

    def description(self) -> dict[str, object]:
        """Return the plan as JSON values, without the place of the town on this machine."""
        values = asdict(self)
        del values["town"]
        if self.drawn is None:  # so that logs that do not vary stay what they are
            del values["drawn"]
        if self.drive.frames == FRAME_COUNT:  # likewise
            del values["drive"]["frames"]
        return {**values, "seed": list(self.seed)}


def render_recording(plan: RecordingPlan) -> Recording:
    """Return the recording of a plan; frames are rendered one by one as they are asked for."""
    description = json.dumps(plan.description(), indent=2, sort_keys=True) + "\n"
    return Recording(
        name=plan.name,
        dataset=plan.dataset,
        split=plan.split,
        group=plan.name.partition("_")[0],  # the town: town03
        calibrations={CAMERA_NAME: plan.conditions.calibration},
        source_digest=plan.digest,
        encoded_here=True,
        moments=partial(_moments, plan),
        source_files={"plan.json": description.encode()},
        conditions=plan.drawn.quantities(plan.stereo) if plan.drawn else {},
    )


def _moments(plan: RecordingPlan) -> Iterator[Moment]:
    town = load_town(plan.town)
    path = drives.ego_path(town.traffic, plan.drive)
    assert path is not None, "a plan's drive was checked when it was chosen"
    stamps, reports, light, errors = recording_streams(plan.seed)
    times_s = plan.drive.start_s + np.arange(plan.drive.frames) / drives.FRAME_RATE_HZ
    times_s += np.append(0.0, stamps.normal(0.0, STAMP_JITTER_S, plan.drive.frames - 1))
    motion_noise = drives.EXACT_MOTION if plan.stereo == "exact" else plan.conditions.motion
    reported = drives.report(path, times_s, motion_noise, reports)
    rig = Rig(plan.conditions, plan.stereo, errors)
    widening = max(_WIDENING, plan.conditions.side_slope + _WIDENING_BEYOND)
    stage = Stage(town, rig.cameras, draw_sunlight(light), _places(path, times_s), widening)
    for time_s, told in zip(times_s, _rounded(reported), strict=True):
        stamp_ns = round(float(time_s) * 1e9)
        pose = Pose(stamp_ns, *_rounded(np.array(path.at(float(time_s))[:3])))
        others = stage.others(float(time_s), pose, plan.drive.actor)
        frame = rig.frame(stamp_ns, stage.pictures(others, float(time_s), pose))
        sample = MotionSample(stamp_ns, *told)
        yield Moment(stamp_ns, {CAMERA_NAME: frame}, (sample,), pose, (*_actors(others), *_actors(stage.parked)))


def _places(path: drives.Trajectory, times_s: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return where the vehicle is first, and whenever it has gone farther than a drive of 30 frames goes."""
    places = [path.at(float(times_s[0]))[:2]]
    for time_s in times_s[1:]:
        here = path.at(float(time_s))[:2]
        if math.dist(here, places[-1]) > _APART_M:
            places.append(here)
    return places


def _rounded(values: NDArray[np.float64]) -> Any:  # noqa: ANN401 - floats, in lists as deep as the array
    """Round metres, radians and their rates to millionths: processors differ in the last bits of a sine."""
    return (np.round(values, 6) + 0.0).tolist()  # no -0.0


def _actors(group: Snapshot) -> list[Actor]:
    height_m = heights_m(group.actor, group.type_index)
    columns = np.column_stack([group.centre_m, group.yaw_rad, height_m, group.velocity_mps])
    found = []
    ids = actor_ids(group).tolist()
    for actor_id, type_index, values in zip(ids, group.type_index, _rounded(columns), strict=True):
        user = ROAD_USERS[type_index]
        x_m, y_m, yaw_rad, high_m, velocity_x, velocity_y = values
        size_m = (user.length_m, user.width_m, high_m)
        found.append(Actor(actor_id, user.label_id, x_m, y_m, yaw_rad, *size_m, velocity_x, velocity_y))
    return found
