"""Logs whose errors can be drawn again: which sources can, and what they give; to add one, add a line to `REDRAWN`."""

import importlib
from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.log.reader import LogReader


class Pictures(NamedTuple):
    """Labels and disparity of a camera at one time, as in `CameraFrame`."""

    label: NDArray[np.uint8]  # (H, W) Cityscapes label ids
    disparity: NDArray[np.uint16]  # (H, W) d_px = (p - 1) / 256; 0 is invalid


class Redrawing(Protocol):
    """Draws the errors of one recording again, onto exact pictures; frames are numbers in the recording.

    Draws are numbered, and draw k is the same however many are asked for.
    """

    def continued(self, exact: Pictures, newest: int, target: int, draws: int) -> Iterator[Pictures]:
        """Draw what may be measured at frame `target`, given all that the errors were up to frame `newest`."""

    def fresh(self, exact: Pictures, target: int, draws: int) -> Iterator[Pictures]:
        """Draw what may be measured at frame `target`, of errors that know nothing of the recording's own."""


REDRAWN = {"plan.json": "semgrid_eval.sources.town.redrawing:of_log"}
"""What draws the errors of a camera again, as `module:function` of an open log and the camera's name.

They are found by the attachment that they need.
"""


def redrawing_of(log: LogReader, camera: str) -> Redrawing:
    """Find what draws the errors of a log's camera again.

    Raises:
        UnknownTruthError: the log does not say how its errors came about.
        LogError: what it says of that is damaged.
    """
    attachments = log.attachments()
    for name, place in REDRAWN.items():
        if name in attachments:
            module, _, function = place.partition(":")
            found: Redrawing = getattr(importlib.import_module(module), function)(log, camera)
            return found
    fault = "holds no exact pictures whose errors can be drawn again: simulated logs do, recordings of sensors do not"
    raise UnknownTruthError(fault, path=log.path)
