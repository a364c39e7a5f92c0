"""Small Cityscapes trees, whole or broken on purpose."""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.sources.cityscapes.tree import CityscapesOptions, find_sequences

FRAME_NS = 58_823_529
CAMERA = {
    "extrinsic": {"baseline": 0.21, "pitch": 0.04, "roll": 0.01, "x": 1.7, "y": 0.1, "yaw": -0.02, "z": 1.22},
    "intrinsic": {"fx": 70.5, "fy": 70.25, "u0": 31.5, "v0": 15.75},
}


@dataclass
class Tree:
    """A Cityscapes sequence tree below `root` whose pictures are of `size` (width, height)."""

    root: Path
    size: tuple[int, int] = (64, 32)
    split: str = "val"
    city: str = "aachen"
    camera_every_frame: bool = True
    gt_fine: bool = False
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(7))

    def path(self, channel: str, frame: str, suffix: str) -> Path:
        return self.root / channel / self.split / self.city / f"{frame}_{suffix}"

    def image(self, frame: str) -> Path:
        return self.path("leftImg8bit_sequence", frame, "leftImg8bit.png")

    def disparity(self, frame: str) -> Path:
        return self.path("disparity_sequence", frame, "disparity.png")

    def vehicle(self, frame: str) -> Path:
        return self.path("vehicle_sequence", frame, "vehicle.json")

    def timestamp(self, frame: str) -> Path:
        return self.path("timestamp_sequence", frame, "timestamp.txt")

    def camera(self, frame: str) -> Path:
        return self.path("camera", frame, "camera.json")

    def gt(self, frame: str) -> Path:
        return self.path("gtFine", frame, "gtFine_labelIds.png")

    def name(self, number: int, sequence: int = 0) -> str:
        return f"{self.city}_{sequence:06d}_{number:06d}"

    def write(self, numbers: Iterable[int], sequence: int = 0) -> list[str]:
        """Write frames and return their names."""
        names = [self.name(number, sequence) for number in numbers]
        for position, name in enumerate(names):
            self._frame(name, int(name.rsplit("_", 1)[1]), position, len(names))
        return names

    def _frame(self, name: str, number: int, position: int, count: int) -> None:
        width, height = self.size
        picture = self.rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
        put(self.image(name), cv2.imencode(".png", picture)[1].tobytes())
        put(self.disparity(name), encode_gray(self.rng.integers(0, 1 << 15, (height, width)).astype(np.uint16)))
        motion = {"speed": 5.0 + 0.01 * number, "yawRate": 0.02, "gpsLatitude": 50.7, "gpsLongitude": 6.1}
        put_json(self.vehicle(name), {**motion, "gpsHeading": 271.5, "outsideTemperature": 19.5})
        put(self.timestamp(name), str(10**15 + number * FRAME_NS).encode())
        annotated = position == min(19, count - 1)
        if self.camera_every_frame or annotated:
            put_json(self.camera(name), CAMERA)
        if self.gt_fine and annotated:
            put(self.gt(name), self.label())

    def label(self, *, highest: int = 33) -> bytes:
        """Make a random 8-bit label image."""
        width, height = self.size
        return encode_gray(self.rng.integers(0, highest + 1, (height, width), dtype=np.uint8))


def put(path: Path, data: bytes) -> None:
    """Write a file and the folders above it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def put_json(path: Path, value: Any) -> None:
    """Write JSON, NaN included."""
    put(path, json.dumps(value).encode())


def change_json(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change a JSON object in place."""
    value = json.loads(path.read_bytes())
    change(value)
    put_json(path, value)


def sequences(tree, **options):
    """Find the sequences of a tree."""
    return find_sequences(CityscapesOptions(src=tree.root, **options))


def only(tree, **options):
    """Find the only sequence of a tree."""
    (sequence,) = sequences(tree, **options)
    return sequence


def frames(sequence):
    """Convert a sequence; its frames of the one camera."""
    return [moment.cameras["front"] for moment in sequence.recording().moments()]


def fault(tree, **options):
    """The message of the first error that converting the only sequence gives."""
    with pytest.raises(InputError) as caught:
        list(only(tree, **options).recording().moments())
    return str(caught.value)
