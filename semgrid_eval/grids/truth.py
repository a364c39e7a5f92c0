"""What simulated logs know beyond what was measured, window by window: asked for, worked out, kept by digest."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import LogError, ResultError
from semgrid_eval.files import digest_value
from semgrid_eval.grids.recording import FORMAT_VERSION
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.recording.png import encode
from semgrid_eval.recording.types import CameraFrame

_log = logging.getLogger(__name__)
TRUTH_VERSION = 1
"""Counts changes to what is worked out; what was kept by another version is worked out again."""
Stamps = NDArray[np.int64]
Images = NDArray[np.uint8] | NDArray[np.uint16]
_ARRAY = "truth"
_UNFILTERED = (cv2.IMWRITE_PNG_COMPRESSION, 0, 19, 8)  # OpenCV names the last two, the filter and none, from 4.12 on


def truth_versions() -> list[int]:
    """Return the versions of what decides an answer: its own, and that of grids, as whose points votes are counted."""
    return [TRUTH_VERSION, FORMAT_VERSION]


@dataclass(frozen=True)
class WindowTimes:
    """The N windows of one log."""

    first_ns: Stamps  # (N,) of the first frame of each one's recording, whose orientation grids have
    inputs_ns: Stamps  # (N, T), oldest first
    target_ns: Stamps  # (N,)

    def described(self) -> list[object]:
        """Return the times as JSON values."""
        return [self.first_ns.tolist(), self.inputs_ns.tolist(), self.target_ns.tolist()]


class Truth(Protocol):
    """Something that a model, or a score, may ask of the truth; whoever adds one writes a class of this form."""

    def described(self, config: GridConfig) -> list[Any]:
        """Return all that decides the answer, besides the log and the windows, as JSON values."""

    def needed(self, times: WindowTimes) -> WindowTimes:
        """Keep of the windows' times those that the answer depends on, so that rows of other inputs share it."""

    def find(self, log: LogReader, config: GridConfig, times: WindowTimes) -> NDArray[Any]:
        """Work out the answer for the windows of a log, an array (N, ...).

        Raises:
            UnknownTruthError: the log does not hold that truth.
        """


@dataclass(frozen=True)
class Question:
    """What is asked of one log."""

    truth: Truth
    log: Path
    digest: str  # of the log
    config: GridConfig
    times: WindowTimes

    def key(self) -> str:
        """Digest all that decides the answer; what is kept is sealed by it."""
        asked = [type(self.truth).__name__, *self.truth.described(self.config)]
        return digest_value([truth_versions(), self.digest, asked, self.truth.needed(self.times).described()])

    def file(self, folder: Path) -> Path:
        """Where the answer is kept."""
        return folder / f"{self.log.stem}-truth-{self.key()}.npz"

    def kept(self, folder: Path) -> NDArray[Any] | None:
        """Read the answer where it is kept, None where it is not, or is damaged, which is said."""
        file, key = self.file(folder), self.key()
        try:
            return read_answer(file, key)
        except ResultError as error:
            if file.exists():
                _log.warning("%s; the truth is worked out again", error)
            return None

    def answer(self, folder: Path) -> NDArray[Any]:
        """Read the answer, or work it out and keep it.

        Raises:
            UnknownTruthError: the log does not hold that truth.
            LogError: it is damaged, or another log than that of which is asked.
        """
        found = self.kept(folder)
        if found is None:
            with LogReader(self.log) as log:
                if log.digest != self.digest:
                    raise LogError(f"has digest {log.digest}, not {self.digest}", path=self.log)
                found = self.truth.find(log, self.config, self.truth.needed(self.times))
            write_arrays(self.file(folder), {_ARRAY: found}, owner=self.key())
        return found


def read_answer(file: Path, key: str) -> NDArray[Any]:
    """Read a kept answer; a ResultError says that it is missing, damaged or that to another question."""
    return read_arrays(file, (_ARRAY,), owner=key)[_ARRAY]


class FrameLog(LogReader):
    """A log whose cameras show other frames than it holds, in the order of time; everything else is its own."""

    def __init__(self, path: Path, frames: Sequence[CameraFrame]) -> None:
        super().__init__(path)
        self._frames = frames

    def frames(self, camera: str, *, images: bool = False) -> Iterator[CameraFrame]:
        """Iterate over the frames that were given."""
        return iter(self._frames)


def plain_png(picture: Images) -> bytes:
    """Encode a picture that is to be decoded at once."""
    return encode(picture, _UNFILTERED)
