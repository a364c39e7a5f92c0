"""Renders one recording frame by frame: what the cameras see, what the vehicle reports, and the truth."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.files import digest_value
from semgrid_eval.recording.types import Actor, Moment, MotionSample, Pose, Recording
from semgrid_eval.sources.town import motion
from semgrid_eval.sources.town.bodies import actor_ids, heights_m
from semgrid_eval.sources.town.drives import FRAME_COUNT, FRAME_RATE_HZ, Drive, ego_path
from semgrid_eval.sources.town.rig import Rig
from semgrid_eval.sources.town.road_users import ROAD_USERS
from semgrid_eval.sources.town.sensors import Camera, cityscapes_camera
from semgrid_eval.sources.town.shading import draw_sunlight
from semgrid_eval.sources.town.stage import Stage
from semgrid_eval.sources.town.town import load_town
from semgrid_eval.sources.town.traffic import Snapshot

CAMERA_NAME = "front"
RENDER_VERSION = 2
"""Counts changes to what a plan renders to; logs of another version are rendered again."""
STAMP_JITTER_S = 0.001


@dataclass(frozen=True)
class RecordingPlan:
    """Everything that determines a recording; small, and cheap to send to another process."""

    name: str  # of the recording
    split: str  # `train` or `val`
    town: Path  # folder of the town
    town_digest: str  # of the town's specification
    drive: Drive  # which car, from when
    seed: tuple[int, ...]  # of the recording's random numbers
    width_px: int  # of the images
    height_px: int  # of the images
    stereo: str  # `modelled`, `matched`, or `exact` for perfect labels, disparity and motion
    dataset: str = "synthetic"  # named in the log

    @property
    def digest(self) -> str:
        """Digest of everything that determines the content."""
        return digest_value({"plan": self.description(), "version": RENDER_VERSION})

    def description(self) -> dict[str, object]:
        """Return the plan as JSON values, without the place of the town on this machine."""
        values = asdict(self)
        del values["town"]
        return {**values, "seed": list(self.seed)}


def render_recording(plan: RecordingPlan) -> Recording:
    """Return the recording of a plan; frames are rendered one by one as they are asked for.

    Raises:
        InputError: the town's folder is gone or damaged.
        MissingExtraError: Embree is not installed.
    """
    calibration = cityscapes_camera(plan.width_px, plan.height_px)
    description = json.dumps(plan.description(), indent=2, sort_keys=True) + "\n"
    return Recording(
        name=plan.name,
        dataset=plan.dataset,
        split=plan.split,
        group=plan.name.partition("_")[0],  # the town: town03
        calibrations={CAMERA_NAME: calibration},
        source_digest=plan.digest,
        moments=partial(_moments, plan),
        source_files={"plan.json": description.encode()},
    )


def _moments(plan: RecordingPlan) -> Iterator[Moment]:
    town = load_town(plan.town)
    path = ego_path(town.traffic, plan.drive)
    assert path is not None, "a plan's drive was checked when it was chosen"
    stamps, reports, light, errors = np.random.default_rng(plan.seed).spawn(4)
    times_s = plan.drive.start_s + np.arange(FRAME_COUNT) / FRAME_RATE_HZ
    times_s += np.append(0.0, stamps.normal(0.0, STAMP_JITTER_S, FRAME_COUNT - 1))
    motion_noise = motion.EXACT_MOTION if plan.stereo == "exact" else motion.MotionNoise()
    reported = motion.report(path, times_s, motion_noise, reports)
    camera = Camera(cityscapes_camera(plan.width_px, plan.height_px), plan.width_px, plan.height_px)
    rig = Rig(camera, plan.stereo, errors)
    stage = Stage(town, rig.cameras, draw_sunlight(light), path.at(float(times_s[0]))[:2])
    for time_s, told in zip(times_s, _rounded(reported), strict=True):
        stamp_ns = round(float(time_s) * 1e9)
        pose = Pose(stamp_ns, *_rounded(np.array(path.at(float(time_s))[:3])))
        others = stage.others(float(time_s), pose, plan.drive.actor)
        frame = rig.frame(stamp_ns, stage.pictures(others, float(time_s), pose))
        sample = MotionSample(stamp_ns, *told)
        yield Moment(stamp_ns, {CAMERA_NAME: frame}, (sample,), pose, (*_actors(others), *_actors(stage.parked)))


def _rounded(values: NDArray[np.float64]) -> Any:  # noqa: ANN401 - floats, in lists as deep as the array
    """Round metres, radians and their rates to millionths: processors differ in the last bits of a sine."""
    return (np.round(values, 6) + 0.0).tolist()  # no -0.0


def _actors(group: Snapshot) -> list[Actor]:
    columns = np.column_stack(
        [group.centre_m, group.yaw_rad, heights_m(group.actor, group.type_index), group.velocity_mps]
    )
    found = []
    ids = actor_ids(group).tolist()
    for actor_id, type_index, values in zip(ids, group.type_index, _rounded(columns), strict=True):
        user = ROAD_USERS[type_index]
        x_m, y_m, yaw_rad, height_m, velocity_x, velocity_y = values
        size_m = (user.length_m, user.width_m, height_m)
        found.append(Actor(actor_id, user.label_id, x_m, y_m, yaw_rad, *size_m, velocity_x, velocity_y))
    return found
