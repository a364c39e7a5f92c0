"""A static street of boxes, seen exactly: ground, kerbs, house fronts, poles and parked cars, ray by ray.

Everything is computed from school geometry and shares no code with the package's own projection.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, Moment, MotionSample, Recording

WIDTH, HEIGHT = 256, 128
FRAME_NS = 58_823_529  # 17 Hz
START_NS = 10**18


@dataclass(frozen=True)
class Box:
    """An axis-aligned box of one label in the world: x ahead, y left, z up."""

    label: str
    x0: float
    x1: float
    y0: float
    y1: float
    height: float


@dataclass(frozen=True)
class Mount:
    """How a camera is turned, and by how much its clock is late."""

    yaw_rad: float = 0.0
    late_ns: int = 0


@dataclass
class ToyWorld:
    """A street along x with what stands on it, and the drive of the ego vehicle through it."""

    boxes: list[Box] = field(default_factory=list)
    speed_mps: float = 8.0
    yaw_rate_radps: float = 0.0
    frames: int = 30
    pitch_rad: float = 0.038
    noise_px: float = 0.0
    seed: int = 0
    cameras: dict[str, Mount] = field(default_factory=lambda: {"front": Mount()})

    def calibration(self, camera: str = "front") -> CameraCalibration:
        return CameraCalibration(
            fx_px=282.75,
            fy_px=283.1,
            u0_px=136.6,
            v0_px=63.8,
            baseline_m=0.209,
            x_m=1.7,
            y_m=0.1,
            z_m=1.22,
            roll_rad=0.0,
            pitch_rad=self.pitch_rad,
            yaw_rad=self.cameras[camera].yaw_rad,
        )

    def pose_at(self, since_ns: int) -> tuple[float, float, float]:
        """Where the vehicle is as x, y, yaw, on a true arc."""
        t, w, v = since_ns * 1e-9, self.yaw_rate_radps, self.speed_mps
        if w:
            return v / w * math.sin(w * t), v / w * (1 - math.cos(w * t)), w * t
        return v * t, 0.0, 0.0

    def poses(self) -> list[tuple[float, float, float]]:
        """The poses at the frames of a camera that is not late."""
        return [self.pose_at(frame * FRAME_NS) for frame in range(self.frames)]

    def recording(self, name: str = "toy_000000_000000", split: str = "val", direction: float = 1.0) -> Recording:
        """The recording; `direction` -1 reports the motion with the wrong sign."""
        return Recording(
            name=name,
            dataset="toy",
            split=split,
            calibrations={camera: self.calibration(camera) for camera in self.cameras},
            source_digest=f"{name}-{direction}-{self!r}",
            moments=lambda: self._moments(direction),
        )

    def _moments(self, direction: float) -> Iterator[Moment]:
        rng = np.random.default_rng(self.seed)
        late_ns = sorted({mount.late_ns for mount in self.cameras.values()})
        for since_ns in (frame * FRAME_NS + late for frame in range(self.frames) for late in late_ns):
            stamp_ns = START_NS + since_ns
            cameras = [name for name, mount in self.cameras.items() if (since_ns - mount.late_ns) % FRAME_NS == 0]
            frames = {camera: self._frame(camera, since_ns, rng) for camera in cameras}
            sample = MotionSample(stamp_ns, direction * self.speed_mps, direction * self.yaw_rate_radps)
            yield Moment(stamp_ns, frames, motion=(sample,) if since_ns % FRAME_NS == 0 else ())

    def _frame(self, camera: str, since_ns: int, rng: np.random.Generator) -> CameraFrame:
        label, depth = self.render(self.pose_at(since_ns), camera)
        disparity = 282.75 * 0.209 / depth
        disparity += rng.normal(0, self.noise_px, disparity.shape) if self.noise_px else 0.0
        coded = np.where(np.isfinite(depth) & (disparity > 0), np.rint(disparity * 256) + 1, 0).astype(np.uint16)
        colour = np.repeat(label[..., None] * 7, 3, axis=2)
        return CameraFrame(START_NS + since_ns, png(colour), png(coded), png(label))

    def render(self, pose: tuple[float, float, float], camera: str = "front") -> tuple[np.ndarray, np.ndarray]:
        """Label ids and depth along the optical axis (H, W) from one pose."""
        origin, ray = self._rays(pose, camera)
        depth = np.full((HEIGHT, WIDTH), np.inf)
        label = np.full((HEIGHT, WIDTH), LABEL_ID["sky"], np.uint8)
        with np.errstate(divide="ignore", invalid="ignore"):
            ground = np.where(ray[2] < 0, -origin[2] / ray[2], np.inf)
            y = origin[1] + ground * ray[1]
            hit = np.isfinite(ground) & (ground < 150)
            depth[hit] = ground[hit]
            kinds = np.where(np.abs(y) < 6, LABEL_ID["road"], LABEL_ID["sidewalk"])
            kinds = np.where(np.abs(y) > 11, LABEL_ID["terrain"], kinds)
            label[hit] = kinds[hit]
            for box in self.boxes:
                near, far = self._slabs(box, origin, ray)
                hit = (near < far) & (near > 0.1) & (near < depth)
                depth[hit] = near[hit]
                label[hit] = LABEL_ID[box.label]
        return label, depth

    def _rays(self, pose, camera="front"):
        c = self.calibration(camera)
        u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
        forward, left, up = np.ones(u.shape), -(u - c.u0_px) / c.fx_px, -(v - c.v0_px) / c.fy_px
        cp, sp = math.cos(c.pitch_rad), math.sin(c.pitch_rad)
        forward, up = cp * forward + sp * up, -sp * forward + cp * up
        cy, sy = math.cos(c.yaw_rad), math.sin(c.yaw_rad)
        forward, left = cy * forward - sy * left, sy * forward + cy * left
        x, y, yaw = pose
        cy, sy = math.cos(yaw), math.sin(yaw)
        origin = (x + cy * c.x_m - sy * c.y_m, y + sy * c.x_m + cy * c.y_m, c.z_m)
        return origin, (cy * forward - sy * left, sy * forward + cy * left, up)

    @staticmethod
    def _slabs(box, origin, ray):
        near, far = np.full((HEIGHT, WIDTH), -np.inf), np.full((HEIGHT, WIDTH), np.inf)
        for low, high, o, r in zip((box.x0, box.y0, 0.0), (box.x1, box.y1, box.height), origin, ray, strict=True):
            a, b = (low - o) / r, (high - o) / r
            near, far = np.maximum(near, np.minimum(a, b)), np.minimum(far, np.maximum(a, b))
        return near, far


def png(image: np.ndarray) -> bytes:
    ok, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert ok
    return data.tobytes()


def street(seed: int = 0, **changes) -> ToyWorld:
    """A street with house fronts, parked cars and poles at random places."""
    rng = np.random.default_rng(seed)
    boxes = []
    for side in (-1, 1):
        for x in np.arange(-10, 160, 12):
            front = side * rng.uniform(12, 16)
            y0, y1 = sorted((front, side * 25))
            boxes.append(Box("building", x, x + rng.uniform(7, 12), y0, y1, rng.uniform(5, 14)))
        for x in np.arange(5, 150, 9):
            if rng.random() < 0.5:
                x = x + rng.uniform(0, 3)
                boxes.append(Box("car", x, x + 4.4, *sorted((side * 4.0, side * 5.8)), 1.5))
        for x in np.arange(0, 150, 20):
            y = side * rng.uniform(7, 8)
            boxes.append(Box("pole", x, x + 0.3, y, y + 0.3, 4.0))
    return ToyWorld(boxes, seed=seed, **changes)
