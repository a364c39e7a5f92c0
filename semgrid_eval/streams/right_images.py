"""The right images of stereo pairs, which logs do not hold: a folder of PNG files for each log."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_bytes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import DISPARITY, camera_topic
from semgrid_eval.words import plural

PNG_LIMIT_BYTES = 256 << 20


class RightImages:
    """The right images of one log, in the order of its frames: FOLDER/<name of the recording>/*.png by name.

    Raises:
        InputError: there is no such folder, or it does not hold as many images as the log has frames.
    """

    def __init__(self, folder: Path, log: LogReader, camera: str) -> None:
        self._folder = folder / log.scene.name
        if not self._folder.is_dir():
            raise InputError(f"is not a folder; it should hold the right images of {log.path}", path=self._folder)
        self._files: Sequence[Path] = sorted(self._folder.glob("*.png"))
        frames = sum(1 for _ in log.messages([camera_topic(camera, DISPARITY)]))
        if len(self._files) != frames:
            raise InputError(
                f"holds {plural(len(self._files), 'PNG file')}, and {log.path} has {plural(frames, 'frame')}",
                path=self._folder,
            )

    def read(self, number: int) -> bytes:
        """Read the file that belongs to a frame of the log."""
        return read_bytes(self._files[number], limit=PNG_LIMIT_BYTES)

    def check(self, number: int, left: NDArray[np.uint8], right: NDArray[np.uint8], widest_px: int) -> None:
        """Refuse a pair of images (H, W, 3) that cannot be matched over disparities up to `widest_px`."""
        if left.shape != right.shape:
            sizes = [f"{picture.shape[1]} x {picture.shape[0]} px" for picture in (right, left)]
            raise InputError(f"is {sizes[0]}, and the left image {sizes[1]}", path=self._files[number])
        if right.shape[1] <= widest_px:
            fault = f"is {right.shape[1]} px wide, and disparities up to {widest_px} px are looked for"
            raise InputError(fault, path=self._files[number])
