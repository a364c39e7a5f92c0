"""Small sequences in KITTI's layout, made of a toy world."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE3

FOCAL_PX, WIDTH, HEIGHT, BASELINE_M = 120.0, 320, 96, 0.54
CAMERA0_M = (1.68, 0.0, 1.65)
SCANNER_M = (0.3, 0.0, -0.1)
"""Where camera 0 is from the scanner: ahead, left, up."""
STEP_NS = 100_000_000
CAMERA0_FROM_SCANNER = CAMERA_FROM_OPTICAL.inverse() @ SE3(np.eye(3), -np.array(SCANNER_M))


@dataclass(frozen=True)
class Sequence:
    """What a sequence holds; points and labels are the same in each scan."""

    frames: int = 4
    speed_mps: float = 8.0
    yaw_rate_radps: float = 0.0
    points: tuple[tuple[float, float, float], ...] = ((10.0, 2.0, -1.5), (20.0, -3.0, 0.5))
    labels: tuple[int, ...] | None = (40, 252 | 7 << 16)
    images: bool = False

    def write(self, root: Path, name: str = "03") -> Path:
        """Write it, and return its folder."""
        folder = root / "sequences" / name
        (folder / "velodyne").mkdir(parents=True)
        (folder / "calib.txt").write_text(calibration_text())
        (folder / "times.txt").write_text("".join(f"{n * STEP_NS * 1e-9:e}\n" for n in range(self.frames)))
        (folder / "poses.txt").write_text("".join(pose_line(self.pose(n)) for n in range(self.frames)))
        for number in range(self.frames):
            self._scan(folder, number)
            if self.images:
                self._pair(folder, number)
        return folder

    def pose(self, number: int) -> SE3:
        """Where camera 0 is in the axes of its first frame, on steps that are straight and turn at their ends."""
        x_m = y_m = yaw = 0.0
        step_s = STEP_NS * 1e-9
        for _ in range(number):
            x_m += self.speed_mps * step_s * np.cos(yaw)
            y_m += self.speed_mps * step_s * np.sin(yaw)
            yaw += self.yaw_rate_radps * step_s
        vehicle = SE3.from_roll_pitch_yaw(0.0, 0.0, yaw, (x_m, y_m, 0.0))
        vehicle_from_camera0 = SE3(np.eye(3), np.array(CAMERA0_M)) @ CAMERA_FROM_OPTICAL
        return vehicle_from_camera0.inverse() @ vehicle @ vehicle_from_camera0

    def _scan(self, folder: Path, number: int) -> None:
        points = np.array(self.points, "<f4").reshape(-1, 3)
        scan = np.column_stack([points, np.full(len(points), 0.5, "<f4")])
        (folder / "velodyne" / f"{number:06d}.bin").write_bytes(scan.astype("<f4").tobytes())
        if self.labels is not None:
            (folder / "labels").mkdir(exist_ok=True)
            (folder / "labels" / f"{number:06d}.label").write_bytes(np.array(self.labels, "<u4").tobytes())

    def _pair(self, folder: Path, number: int) -> None:
        """Write a wall of noise 8 px nearer in the right image."""
        wall = np.random.default_rng(number).integers(0, 255, (HEIGHT, WIDTH + 8, 3), np.uint8)
        wall = cv2.GaussianBlur(wall, (5, 5), 1.0)
        for channel, picture in (("image_2", wall[:, :-8]), ("image_3", wall[:, 8:])):
            (folder / channel).mkdir(exist_ok=True)
            cv2.imwrite(str(folder / channel / f"{number:06d}.png"), picture)


def calibration_text() -> str:
    """Projections of four cameras, of which the left colour one is 6 cm left of camera 0, and the scanner's place."""
    lines = []
    for camera, right_m in enumerate((0.0, BASELINE_M, -0.06, BASELINE_M - 0.06)):
        projection = np.array([[FOCAL_PX, 0, 160.0, -FOCAL_PX * right_m], [0, FOCAL_PX, 48.0, 0], [0, 0, 1, 0]])
        lines.append(f"P{camera}: " + " ".join(f"{each:e}" for each in projection.ravel()))
    return "\n".join([*lines, "Tr: " + matrix_text(CAMERA0_FROM_SCANNER)]) + "\n"


def matrix_text(pose: SE3) -> str:
    """The twelve numbers of a pose."""
    return " ".join(f"{each:.12e}" for each in np.column_stack([pose.rotation, pose.translation_m]).ravel())


def pose_line(pose: SE3) -> str:
    """A line of `poses.txt`."""
    return matrix_text(pose) + "\n"
