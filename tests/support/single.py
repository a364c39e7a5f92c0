"""Single cameras, without disparity: those of other recordings, and a street seen by two and a LiDAR."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
from support.toy_world import FRAME_NS, START_NS, Mount, ToyWorld, street

from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.lidar import Mount as Roof
from semgrid_eval.recording.types import CameraFrame, Moment, MotionSample, Recording

LATE_NS = FRAME_NS // 2
ROOF = Roof((1.0, 0.0, 1.9), (0.0, 0.0, 0.0, 1.0))
RIG = {"left": Mount(0.4), "right": Mount(-0.4, LATE_NS)}
_EVERY_PX, _FARTHEST_M = 3, 60.0


def single(recording: Recording, *cameras: str) -> Recording:
    """Take the disparity away from some cameras, or from all; a frame that then shows nothing goes with it."""
    names = cameras or tuple(recording.calibrations)
    calibrations = {
        name: replace(each, baseline_m=None) if name in names else each for name, each in recording.calibrations.items()
    }

    def moments() -> Iterator[Moment]:
        for moment in recording.moments():
            frames = {name: _bare(each) if name in names else each for name, each in moment.cameras.items()}
            yield replace(moment, cameras={name: each for name, each in frames.items() if _shows(each)})

    return replace(recording, calibrations=calibrations, moments=moments)


def _shows(frame: CameraFrame) -> bool:
    return any(each is not None for each in (frame.image_file, frame.label_png, frame.disparity_png))


def _bare(frame: CameraFrame) -> CameraFrame:
    return replace(frame, disparity_png=None, exact_disparity_png=None)


@cache
def single_rig(*, frames: int = 16, seed: int = 1, split: str = "val", labelled: bool = False) -> Recording:
    """A street seen by two single cameras with clocks of their own, and every second time by a LiDAR.

    The LiDAR sees what the eye of the cameras sees; with `labelled`, its points have their true labels.
    """
    world = street(seed, frames=frames, cameras=RIG)
    seen = single(world.recording(f"rig{seed}", split))

    def moments() -> Iterator[Moment]:
        for moment in seen.moments():
            since_ns = moment.stamp_ns - START_NS
            swept = since_ns % (2 * FRAME_NS) == 0
            sample = MotionSample(moment.stamp_ns, world.speed_mps, world.yaw_rate_radps)
            sweeps = {"top": swept_street(world, since_ns, labelled=labelled)} if swept else {}
            yield replace(moment, motion=(sample,), sweeps=sweeps)

    found = tuple(moments())
    return replace(seen, moments=lambda: iter(found))


def swept_street(world: ToyWorld, since_ns: int, *, labelled: bool) -> LidarSweep:
    """Points of what two cameras of the world see, in the frame of a LiDAR on the roof."""
    points, labels = [], []
    for camera in RIG:
        label, depth_m = (each[::_EVERY_PX, ::_EVERY_PX] for each in world.render(world.pose_at(since_ns), camera))
        origin, ray = world._rays((0.0, 0.0, 0.0), camera)  # from where the vehicle is
        known = depth_m < _FARTHEST_M
        at_m = [
            o + depth_m[known] * r[::_EVERY_PX, ::_EVERY_PX][known] for o, r in zip(origin, _full(ray), strict=True)
        ]
        points.append(np.stack(at_m, axis=1) - ROOF.place_m)
        labels.append(label[known])
    found = np.concatenate(points).astype(np.float32)
    label_id = np.concatenate(labels).astype(np.uint8) if labelled else None
    return LidarSweep(START_NS + since_ns, ROOF, found, np.ones(len(found), np.float32), label_id)


def _full(ray):
    shape = np.broadcast_shapes(*(np.shape(each) for each in ray))
    return [np.broadcast_to(each, shape) for each in ray]
