"""The frames of a log on their way through a perception chain, one after another, as if a vehicle sent them."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.errors import LogError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import Cells, add_points, no_points, rasterise
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.models.model import Given, Model, require_answer
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.segmentation.network import SegmentationNetwork
from semgrid_eval.sensors.camera import CameraSensor, stereo_camera
from semgrid_eval.sensors.projection import Projection
from semgrid_eval.sensors.sensor import Points
from semgrid_eval.sources.matching import SemiGlobalMatching
from semgrid_eval.streams.laps import Laps
from semgrid_eval.streams.right_images import RightImages
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.windows.grids import shift_grids, shift_in_cells
from semgrid_eval.windows.plan import WindowConfig

_NAME, _SENSOR = "full", CameraSensor()


def grid_of(camera: str | None) -> GridConfig:
    """Say what the chain makes of a frame: the whole image of a camera, of a log's only one unless named, as a grid."""
    return GridConfig(sensors={_NAME: CameraSensor(camera=camera)}, target=(_NAME,))


GRID = grid_of(None)
"""The paper's grid."""
WINDOW = WindowConfig()
"""Which grids models see, and how far ahead they predict."""
GIVEN = Given((_NAME,), WINDOW.inputs, GRID.spec.rows, GRID.spec.columns, GRID.spec.cell_m, translate=True)
"""What the chain gives its models."""
Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Chain:
    """What a chain is made of."""

    models: Mapping[str, Model]  # each predicts every frame
    device: torch.device  # where grids are aligned and models run
    segmentation: SegmentationNetwork | None = None  # makes the labels; else those of the log are taken
    right: Path | None = None  # of right images, for matching, which then makes the disparity; else that of the log
    camera: str | None = None  # whose frames are taken; else those of a log's only one with disparity


class _Pictures(NamedTuple):
    """What the chain decodes of a frame, (H, W) or (H, W, 3) RGB; None is what it makes itself, or does not need."""

    label: Image | None
    disparity: NDArray[np.uint16] | None
    left: Image | None
    right: Image | None


class _Seen(NamedTuple):
    """What the chain remembers of a frame."""

    grid: Tensor  # (H, W) uint8
    place: SE2  # of the vehicle, in the grid's axes
    stamp_ns: int


class LiveLog:
    """Puts the frames of one log through a chain."""

    def __init__(self, log: LogReader, chain: Chain) -> None:
        self._log, self._chain = log, chain
        self.camera = stereo_camera(log, chain.camera)
        calibration = log.calibration(self.camera)
        self._projection = Projection(calibration, _SENSOR.image_size_px, GRID.class_by_label())
        self._matching = SemiGlobalMatching(calibration)
        self._right = RightImages(chain.right, log, self.camera) if chain.right else None
        self._coming = deque(log.motion())
        if not self._coming:
            raise LogError("has no motion samples", path=log.path)
        self._motion = EgoMotion(integrator=GRID.integrator)
        self._first: SE2 | None = None
        self._seen = deque[_Seen](maxlen=WINDOW.span_frames + 1)

    @property
    def needs_colour(self) -> bool:
        """Whether colour images are needed."""
        return self._chain.segmentation is not None or self._right is not None

    def take(self, frame: CameraFrame, number: int, laps: Laps) -> bool:
        """Put the next frame through all stages, and tell whether there were grids enough for the models."""
        right_png = self._right.read(number) if self._right else None  # from a camera, not from a disk
        with laps.stage("decode"):
            pictures = self._decoded(frame, right_png)
        label, disparity = self._labelled(pictures, laps), self._matched(pictures, number, laps)
        with laps.stage("grid"):
            self._hear(frame.stamp_ns)
            place = self._place(frame.stamp_ns)
            grid = self._grid(disparity, label, place.yaw_rad)
        with laps.stage("align"):
            self._seen.append(_Seen(torch.from_numpy(grid).to(self._chain.device), place, frame.stamp_ns))
            batch = self._aligned() if len(self._seen) == self._seen.maxlen else None
        if batch is None:
            return False
        for name, model in self._chain.models.items():
            with laps.model(name):
                _answer(model, batch)
        return True

    def _decoded(self, frame: CameraFrame, right_png: bytes | None) -> _Pictures:
        label = disparity = left = None
        if self._chain.segmentation is None:
            png = self._needed(frame.label_png, "label image; `semgrid-eval segment` adds them", frame)
            label = decode_gray(png, bit_depth=8, path=self._log.path).astype(np.uint8, copy=False)
        if self._right is None:
            png = self._needed(frame.disparity_png, "disparity", frame)
            disparity = decode_gray(png, bit_depth=16, path=self._log.path).astype(np.uint16, copy=False)
        if self.needs_colour:
            left = decode_colour(self._needed(frame.image_file, "colour image", frame), path=self._log.path)
        return _Pictures(label, disparity, left, None if right_png is None else decode_colour(right_png))

    def _needed(self, png: bytes | None, what: str, frame: CameraFrame) -> bytes:
        if png is None:
            raise LogError(f"has no {what}", path=self._log.path, field=f"frame at {frame.stamp_ns} ns")
        return png

    def _labelled(self, pictures: _Pictures, laps: Laps) -> Image:
        """Return the labels (H, W), by segmentation where there is one."""
        if self._chain.segmentation is None:
            assert pictures.label is not None
            return pictures.label
        assert pictures.left is not None
        with laps.stage("segment"):
            return self._chain.segmentation.label(pictures.left)

    def _matched(self, pictures: _Pictures, number: int, laps: Laps) -> NDArray[np.uint16]:
        """Return the disparity (H, W), coded as in logs, by matching where there is a right image."""
        if self._right is None:
            assert pictures.disparity is not None
            return pictures.disparity
        assert pictures.left is not None
        assert pictures.right is not None
        self._right.check(number, pictures.left, pictures.right, self._matching.margin_px)
        with laps.stage("match"):
            grey = [cv2.cvtColor(each, cv2.COLOR_RGB2GRAY) for each in (pictures.left, pictures.right)]
            left, right = (np.asarray(each, np.uint8) for each in grey)
            return coded_disparity(self._matching.disparity_px(left, right))

    def _hear(self, stamp_ns: int) -> None:
        """Take in the motion that has been reported by a time."""
        while self._coming and self._coming[0].stamp_ns <= stamp_ns:
            self._motion.add(self._coming.popleft())

    def _place(self, stamp_ns: int) -> SE2:
        """Return where the vehicle is, or will be by what it reported last, in the axes of its first frame."""
        here = self._motion.odom_from_vehicle(stamp_ns)
        self._first = self._first or here
        return here.seen_from(self._first)

    def _grid(self, disparity: NDArray[np.uint16], label: Image, yaw_rad: float) -> Cells:
        """Make the grid (H, W) of a frame."""
        pixels = self._projection.points(disparity, label)
        counts = no_points(GRID)
        points = Points(_NAME, 0, pixels.forward_m, pixels.left_m, pixels.class_id)
        add_points(counts, points, SE2(0.0, 0.0, yaw_rad), GRID.spec)
        return rasterise(counts, GRID.classes, GRID.morphology)

    def _aligned(self) -> WindowBatch:
        """Move the inputs to where the vehicle will be if it goes on as it was reported last: a batch of one window."""
        now, inputs = self._seen[-1], list(self._seen)[:: WINDOW.step_frames]
        gap_ns = (now.stamp_ns - self._seen[0].stamp_ns) / WINDOW.span_frames
        target_ns = now.stamp_ns + round(WINDOW.lead_frames * gap_ns)
        there, device = self._place(target_ns), self._chain.device
        moved_m = np.array([(there.x_m - each.place.x_m, there.y_m - each.place.y_m) for each in inputs])
        shift_cells = torch.from_numpy(shift_in_cells(moved_m, GRID.spec.cell_m)).to(device)[None]
        lead_s = torch.tensor([[(target_ns - each.stamp_ns) * 1e-9 for each in inputs]], device=device)
        past = torch.stack([each.grid for each in inputs])[None, None]
        unknown = torch.zeros_like(past[:, 0, 0])
        aligned = shift_grids(past, shift_cells[:, None])
        return WindowBatch(aligned, (_NAME,), shift_cells, lead_s, target=unknown, mask=unknown.bool())


def _answer(model: Model, batch: WindowBatch) -> Cells:
    """Predict, and bring the classes (H, W) to where they can be sent from."""
    with torch.inference_mode():
        scores = require_answer(model.predict(batch), batch, model)
        return np.asarray(scores.argmax(dim=1).to(torch.uint8)[0].cpu().numpy())
