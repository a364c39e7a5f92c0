"""Where true actors stand near the targets: flags are read from a recording when they are first asked for."""

import zlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # building grids needs the log readers; using built ones does not
    from semgrid_eval.grids.recording import RecordingGrids

Flags = NDArray[np.uint8]
_FASTEST = 1


class ActorFlags:
    """The flags of all recordings.

    What was worked out of them for a target is kept compressed (some hundred bytes), as all rows ask for the same.
    """

    def __init__(self, recordings: Sequence["RecordingGrids"]) -> None:
        self._recordings = recordings
        self.known = [recording.has_truth for recording in recordings]
        self._newest: tuple[int, Flags] | None = None  # number of the recording that was read last, and its flags
        self._near: dict[int, bytes] = {}

    def of(self, recording: int) -> Flags:
        """Read the flags of a recording whose log holds the truth: (F, H, W) of its frames."""
        if self._newest is None or self._newest[0] != recording:
            self._newest = recording, self._recordings[recording].flags()
        return self._newest[1]

    def near(self, target: int, work_out: Callable[[], Flags]) -> Flags:
        """Return what was worked out for a target, a frame along F, or work it out: (H, W)."""
        if target not in self._near:
            found = work_out()
            self._near[target] = zlib.compress(found.tobytes(), _FASTEST)
            return found
        return np.frombuffer(zlib.decompress(self._near[target]), np.uint8)
