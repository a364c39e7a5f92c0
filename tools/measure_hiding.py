"""Measure which points of Argoverse's sweeps are hidden from its ring cameras, by `occlusion_rad` and size of images.

Prints a table (Markdown): the share of the points in an image that are hidden, of all; of those that truly are behind
a vehicle, as the line of sight goes through its body, which is its box up to .6 of the height (below bonnets and
windows), a tenth smaller at each other side; and of the ground up to 40 m away whose line of sight meets no box.
Sweeps are those at a time of boxes; no images are needed.

Example: python tools/measure_hiding.py SRC/val/LOG --camera ring_front_center --camera ring_side_left
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import SemgridError
from semgrid_eval.geometry import SE3
from semgrid_eval.recording.types import CameraCalibration
from semgrid_eval.sensors.colouring import PointPixels, reach_px
from semgrid_eval.sensors.projection import unit_projection
from semgrid_eval.sources.argoverse2.cameras import read_camera
from semgrid_eval.sources.argoverse2.drive import Drive
from semgrid_eval.sources.argoverse2.taken import Every
from semgrid_eval.sources.argoverse2.tracks import read_boxes, transform
from semgrid_eval.sources.argoverse2.vehicle import EGO_FROM_ARGOVERSE

ANGLES_RAD = (0.0, 0.0023, 0.0057, 0.009, 0.01, 0.015, 0.02)
SCALES = (1, 4)
VEHICLES = ("REGULAR_VEHICLE", "LARGE_VEHICLE", "TRUCK", "BOX_TRUCK", "BUS", "ARTICULATED_BUS", "SCHOOL_BUS")
BODY = np.array([[-0.8, -0.8, -0.8], [0.8, 0.8, 0.2]])  # of half a box's length, width and height, from its middle
BOX = np.array([[-1.0] * 3, [1.0] * 3])
NEARER = 0.85  # what is nearer than this share of a point's distance can hide it
GROUND_M, AHEAD_M = 0.3, 40.0
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Box:
    """A vehicle: its pose in the vehicle frame, and half its length, width and height."""

    ego_from_box: SE3
    half_m: Floats

    def holds(self, points_m: Floats) -> Flags:
        """Tell which points (N, 3) lie in the box: (N,)."""
        return np.asarray((abs(self.ego_from_box.inverse().apply(points_m)) <= self.half_m).all(axis=1))

    def hides(self, points_m: Floats, eye_m: Floats, part: Floats) -> Flags:
        """Tell which points (N, 3) an eye sees through a part of the box, `BODY` or all of it: (N,)."""
        box_from_ego = self.ego_from_box.inverse()
        eye = box_from_ego.apply(eye_m[None])
        way = box_from_ego.apply(points_m) - eye
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.sort((part[:, None] * self.half_m - eye) / way, axis=0)
        enters, leaves = sides[0].max(axis=1), sides[1].min(axis=1)
        return np.asarray((enters > 0) & (enters < leaves) & (leaves < NEARER) & ~self.holds(points_m))


def boxes_at(log: Path) -> dict[int, list[Box]]:
    """Return the boxes of vehicles in which the LiDAR saw something, by time."""
    path = log / "annotations.feather"
    table = read_boxes(path)
    found: dict[int, list[Box]] = {}
    for row in np.flatnonzero(np.isin(table["category"].astype(str), VEHICLES) & (table["num_interior_pts"] > 0)):
        half_m = np.array([table[name][row] / 2 for name in ("length_m", "width_m", "height_m")])
        box = Box(EGO_FROM_ARGOVERSE @ transform(table, int(row), path), half_m)
        found.setdefault(int(table["timestamp_ns"][row]), []).append(box)
    return found


def sweeps_of(log: Path) -> Iterator[tuple[int, Floats]]:
    """Yield time and points (N, 3) in the vehicle frame of each sweep."""
    for moment in Drive(log, log.parent.name, Every(0, 0)).recording().moments():
        for sweep in moment.sweeps.values():
            yield moment.stamp_ns, sweep.mount.ego_from_sensor.apply(sweep.points_m.astype(np.float64))


def counted(log: Path, name: str) -> NDArray[np.int64]:
    """Count points of a camera: scale, angle; all, behind a vehicle, other ground; hidden, and all of them."""
    camera = read_camera(log, name, "--ring-every")
    calibration = CameraCalibration.of(camera.matrix, camera.ego_from_optical, None)
    projection = unit_projection(calibration, camera.size_px)
    eye_m, boxes = camera.ego_from_optical.translation_m, boxes_at(log)
    found = np.zeros((len(SCALES), len(ANGLES_RAD), 3, 2), np.int64)
    for stamp_ns, points_m in sweeps_of(log):
        projected = projection @ np.column_stack([points_m, np.ones(len(points_m))]).T
        for scale, counts in zip(SCALES, found, strict=True):
            shape = (camera.size_px.height // scale, camera.size_px.width // scale)
            pixels = PointPixels.of(projected, shape)
            kinds = kinds_of(points_m[pixels.inside], boxes.get(stamp_ns, []), eye_m)
            for angle_rad, count in zip(ANGLES_RAD, counts, strict=True):
                hidden = pixels.hidden(shape, reach_px(angle_rad, calibration, camera.size_px, shape))
                count += np.stack([(kinds & hidden).sum(axis=1), kinds.sum(axis=1)], axis=1)
    return found


def kinds_of(points_m: Floats, boxes: list[Box], eye_m: Floats) -> Flags:
    """Tell of points (N, 3): all of them, which are behind a vehicle, which are other ground that is near: (3, N)."""
    behind, beyond = np.zeros((2, len(points_m)), np.bool_)
    for box in boxes:
        behind |= box.hides(points_m, eye_m, BODY)
        beyond |= box.hides(points_m, eye_m, BOX)
    near = (points_m[:, 2] < GROUND_M) & (np.hypot(points_m[:, 0], points_m[:, 1]) < AHEAD_M)
    return np.stack([np.ones_like(behind), behind, near & ~beyond])


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--camera", action="append", required=True, help="its name; may be given several times")
    options = parser.parse_args()
    try:
        found = sum(counted(options.log, name) for name in options.camera)
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None
    print("| size | `occlusion_rad` | hidden of all | of those behind a vehicle | of other ground |")
    print("|---|---|---|---|---|")
    for scale, counts in zip(SCALES, np.asarray(found), strict=True):
        for angle_rad, count in zip(ANGLES_RAD, counts, strict=True):
            shares = " | ".join(f"{100 * hidden / max(whole, 1):.1f} % of {whole:,}" for hidden, whole in count)
            print(f"| 1/{scale} | {angle_rad:g} | {shares} |")


if __name__ == "__main__":
    main()
