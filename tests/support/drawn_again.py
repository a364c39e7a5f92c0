"""Logs of toy streets with the errors, the truth and the plan of a simulated town's, without simulating one."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from support.toy_world import ToyWorld, png, street

from semgrid_eval.log.store import write_log
from semgrid_eval.recording.disparity import coded_disparity, decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import Moment, Pose, Recording
from semgrid_eval.sources.town.drives import Drive
from semgrid_eval.sources.town.picture_errors import (
    PictureErrors,
    Strengths,
    recording_streams,
)
from semgrid_eval.sources.town.rendering import RecordingPlan


def town_like(world: ToyWorld, name: str, split: str, *seed: int) -> Recording:
    """The recording of a toy world as the simulated town would make it."""
    plan = RecordingPlan(name, split, Path(), "toy", Drive(1, 0.0), seed, 256, 128, "modelled")
    plain = world.recording(name, split)
    files = {"plan.json": _json(plan)}
    moments = partial(_with_errors, world, plain, seed)
    return replace(plain, moments=moments, source_digest=plan.digest, source_files=files)


def write_town_like(folder: Path, *, frames: int = 9) -> Path:
    """Write two logs to train on and two to score."""
    for i, split in enumerate(("train", "train", "val", "val")):
        world = street(i, frames=frames, speed_mps=8 + i, yaw_rate_radps=0.1 * (i - 1))
        write_log(town_like(world, f"toy_{i:06}_000000", split, 7, i), folder / split / f"toy{i}.mcap")
    return folder


def _with_errors(world: ToyWorld, plain: Recording, seed: tuple[int, ...]) -> Iterator[Moment]:
    errors = PictureErrors.begin("modelled", Strengths(), *recording_streams(seed)[-1].spawn(2))
    for moment, pose in zip(plain.moments(), world.poses(), strict=True):
        frame = moment.cameras["front"]
        label = decode_gray(frame.label_png, bit_depth=8)
        disparity = decode_gray(frame.disparity_png, bit_depth=16)
        measured, measured_px = errors.add(label, decoded_disparity(disparity))
        shown = replace(
            frame,
            label_png=png(measured),
            disparity_png=png(coded_disparity(measured_px)),
            exact_label_png=frame.label_png,
            exact_disparity_png=frame.disparity_png,
            instance_png=png(np.zeros(label.shape, np.uint16)),
        )
        yield replace(moment, cameras={"front": shown}, pose=Pose(moment.stamp_ns, *pose), actors=())


def _json(plan: RecordingPlan) -> bytes:
    import json

    return json.dumps(plan.description()).encode()
