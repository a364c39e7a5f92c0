"""Renders one recording frame by frame: what the cameras see, what the vehicle reports, and the truth."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.files import digest_value
from semgrid_eval.frames.synthetic import motion
from semgrid_eval.frames.synthetic.bodies import boxes_of, heights_m
from semgrid_eval.frames.synthetic.drives import FRAME_COUNT, FRAME_RATE_HZ, Drive, ego_path
from semgrid_eval.frames.synthetic.noise import DisparityErrors, DisparityNoise, LabelErrors, LabelNoise
from semgrid_eval.frames.synthetic.road_users import ROAD_USERS
from semgrid_eval.frames.synthetic.sensors import Camera, RayCaster, cityscapes_camera, look
from semgrid_eval.frames.synthetic.shading import draw_sunlight, shade
from semgrid_eval.frames.synthetic.solids import Soup, soup_of_boxes
from semgrid_eval.frames.synthetic.town import Town, load_town
from semgrid_eval.frames.synthetic.traffic import Snapshot
from semgrid_eval.frames.types import Actor, CameraFrame, MotionSample, Moment, Pose, Recording

CAMERA_NAME = "front"
RENDER_VERSION = 1
"""Counts changes to what a plan renders to; logs of another version are rendered anew."""
STAMP_JITTER_S = 0.001
_SIGHT_M = 150.0
_BEHIND_M, _ASIDE_M, _WIDENING = 15.0, 40.0, 0.75  # what throws shadows into the picture is kept, too


@dataclass(frozen=True)
class RecordingPlan:
    """Everything that determines a recording; small, and cheap to send to another process.

    Args:
        name: of the recording.
        split: `train` or `val`.
        town: folder of the town.
        town_digest: of the town's specification.
        drive: which car, from when.
        seed: of the recording's random numbers.
        width_px: of the images.
        height_px: of the images.
        noise: `modelled`, or `exact` for perfect labels, disparity and motion.
    """

    name: str
    split: str
    town: Path
    town_digest: str
    drive: Drive
    seed: tuple[int, ...]
    width_px: int
    height_px: int
    noise: str

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
        dataset="synthetic",
        split=plan.split,
        calibrations={CAMERA_NAME: calibration},
        source_digest=plan.digest,
        moments=partial(_moments, plan),
        source_files={"plan.json": description.encode()},
    )


def _moments(plan: RecordingPlan) -> Iterator[Moment]:
    town = load_town(plan.town)
    path = ego_path(town.traffic, plan.drive)
    assert path is not None, "a plan's drive was checked when it was chosen"
    stamps, reports, light, disparities, labels = np.random.default_rng(plan.seed).spawn(5)
    times_s = plan.drive.start_s + np.arange(FRAME_COUNT) / FRAME_RATE_HZ
    times_s += np.append(0.0, stamps.normal(0.0, STAMP_JITTER_S, FRAME_COUNT - 1))
    is_exact = plan.noise == "exact"
    reported = motion.report(path, times_s, motion.EXACT_MOTION if is_exact else motion.MotionNoise(), reports)
    camera = Camera(cityscapes_camera(plan.width_px, plan.height_px), plan.width_px, plan.height_px)
    errors = None if is_exact else _Errors(disparities, labels)
    stage = _Stage(town, plan.drive.actor, camera, path.at(float(times_s[0]))[:2])
    sunlight = draw_sunlight(light)
    for time_s, (speed_mps, yaw_rate_radps) in zip(times_s, reported, strict=True):
        stamp_ns = round(float(time_s) * 1e9)
        x_m, y_m, yaw_rad, _, _ = path.at(float(time_s))
        pose = Pose(stamp_ns, x_m, y_m, yaw_rad)
        others = stage.others(float(time_s), pose)
        soup = stage.soup(others, float(time_s), pose)
        caster = RayCaster(soup.triangles_m)
        view = look(camera, caster, soup, town.scene.ground, pose)
        image = shade(camera, view, caster, soup, pose, sunlight)
        exact_px = camera.disparity_px(view.depth_m)
        frame = CameraFrame(
            stamp_ns=stamp_ns,
            image_png=_png(image),
            disparity_png=_png(coded_disparity(errors.disparity.add(exact_px) if errors else exact_px)),
            label_png=_png(errors.labels.add(view.label) if errors else view.label),
            exact_label_png=_png(view.label),
            exact_disparity_png=_png(coded_disparity(exact_px)),
            instance_png=_png(view.instance),
        )
        sample = MotionSample(stamp_ns, float(speed_mps), float(yaw_rate_radps))
        yield Moment(stamp_ns, {CAMERA_NAME: frame}, (sample,), pose, _actors(others))


def coded_disparity(disparity_px: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Code disparities (H, W) as Cityscapes does: p = 256 d + 1, and 0 for what is not positive or too large."""
    coded = np.rint(disparity_px * np.float32(256.0)) + np.float32(1.0)
    return np.where((disparity_px > 0.0) & (coded <= 65535.0), coded, 0.0).astype(np.uint16)


class _Errors:
    """The errors of one recording's frames, which depend on those of the frames before."""

    def __init__(self, disparities: np.random.Generator, labels: np.random.Generator) -> None:
        self.disparity = DisparityErrors(DisparityNoise(), disparities)
        self.labels = LabelErrors(LabelNoise(), labels)


class _Stage:
    """The part of a town that one recording can see, and who is on it."""

    def __init__(self, town: Town, ego: int, camera: Camera, place_m: tuple[float, float]) -> None:
        corners = town.scene.soup.triangles_m[:, 0, :2]
        near = np.linalg.norm(corners - np.array(place_m, np.float32), axis=1) < _SIGHT_M
        self._still = town.scene.soup.where(near)
        self._parked = town.scene.parked.where(_is_near(town.scene.parked, *place_m))
        self._traffic = town.traffic
        self._ego = ego
        self._camera = camera

    def others(self, time_s: float, pose: Pose) -> tuple[Snapshot, Snapshot]:
        """Return who is near: road users and parked cars."""
        moving = self._traffic.at(time_s)
        near = _is_near(moving, pose.x_m, pose.y_m) & (moving.actor != self._ego)
        return moving.where(near), self._parked

    def soup(self, others: tuple[Snapshot, Snapshot], time_s: float, pose: Pose) -> Soup:
        """Return all triangles in the vehicle frame that may be seen or throw a shadow that is seen."""
        moving = others[0]
        movers = soup_of_boxes(boxes_of(moving, _actor_ids(moving).astype(np.uint16), time_s))
        soup = Soup.joined([self._still, movers]).seen_from(pose.x_m, pose.y_m, pose.yaw_rad)
        ahead_m, left_m = soup.triangles_m[..., 0].max(axis=1), np.abs(soup.triangles_m[..., 1]).min(axis=1)
        return soup.where((ahead_m > -_BEHIND_M) & (left_m < _ASIDE_M + _WIDENING * np.maximum(ahead_m, 0.0)))


def _is_near(actors: Snapshot, x_m: float, y_m: float) -> NDArray[np.bool_]:
    return np.asarray(np.linalg.norm(actors.centre_m - (x_m, y_m), axis=1) < _SIGHT_M)


def _actor_ids(actors: Snapshot) -> NDArray[np.int32]:
    """Return the ids (A,) of actors; 0 means no actor, so they begin at 1."""
    return actors.actor + 1


def _actors(groups: tuple[Snapshot, Snapshot]) -> tuple[Actor, ...]:
    found = []
    for group in groups:
        heights = heights_m(group.actor, group.type_index)
        for index, actor_id in enumerate(_actor_ids(group)):
            user = ROAD_USERS[group.type_index[index]]
            x_m, y_m = group.centre_m[index]
            velocity_x, velocity_y = group.velocity_mps[index]
            found.append(
                Actor(
                    actor_id=int(actor_id),
                    label_id=user.label_id,
                    x_m=float(x_m),
                    y_m=float(y_m),
                    yaw_rad=float(group.yaw_rad[index]),
                    length_m=user.length_m,
                    width_m=user.width_m,
                    height_m=float(heights[index]),
                    velocity_x_mps=float(velocity_x),
                    velocity_y_mps=float(velocity_y),
                )
            )
    return tuple(found)


def _png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done, "OpenCV encodes every 8 or 16 bit image"
    return data.tobytes()
