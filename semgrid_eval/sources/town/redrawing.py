"""Draws the errors of a log of the simulated town again, from the plan that lies in it; no town and no SUMO is needed.

Errors depend on random numbers and the size of pictures alone. So the plan's seed tells their state after any frame,
and the exact pictures are in the log.
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from semgrid_eval.errors import LogError, UnknownTruthError
from semgrid_eval.files import digest_value
from semgrid_eval.log.reader import LogReader
from semgrid_eval.recording.disparity import coded_disparity, decoded_disparity
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.redrawing import Pictures
from semgrid_eval.sources.town.noise import DisparityNoise, LabelNoise
from semgrid_eval.sources.town.picture_errors import (
    FRONT,
    PictureErrors,
    Strengths,
    error_stream,
)
from semgrid_eval.sources.town.rendering import RENDER_VERSION

_CONTINUED, _FRESH = 0x636F6E74, 0x66726573
"""Tell the random numbers of draws from each other, and from those of recordings."""


class TownErrors:
    """The errors of a camera of one recording; cheapest if it is asked for newest frames in their order."""

    def __init__(
        self, seed: tuple[int, ...], stereo: Stereo, strengths: Strengths | None = None, camera: str = FRONT
    ) -> None:
        self._seed, self._stereo, self._strengths, self._camera = seed, stereo, strengths or Strengths(), camera
        self._errors, self._frame = self._first(), -1

    def continued(self, exact: Pictures, newest: int, target: int, draws: int) -> Iterator[Pictures]:
        """Branch the errors after frame `newest` into draws of frame `target`, as `Redrawing` says."""
        state = self.after(newest, exact)
        for draw in range(draws):
            numbers = self._numbers(_CONTINUED, newest, target, draw)
            yield _with_errors(state.branched(*numbers), exact, target - newest)

    def fresh(self, exact: Pictures, target: int, draws: int) -> Iterator[Pictures]:
        """Draw new errors, as `Redrawing` says."""
        for draw in range(draws):
            errors = PictureErrors.begin(self._stereo, self._strengths, *self._numbers(_FRESH, target, draw))
            yield _with_errors(errors, exact, 1)

    def after(self, frame: int, picture: Pictures) -> PictureErrors:
        """Return the errors as they are after a frame; the picture tells the size."""
        if frame < self._frame:
            self._errors, self._frame = self._first(), -1
        blank, blank_px = np.zeros_like(picture.label), np.zeros(picture.label.shape, np.float32)
        for _ in range(frame - self._frame):
            self._errors.add(blank, blank_px)
        self._frame = frame
        return self._errors

    def _first(self) -> PictureErrors:
        """Return the errors before the first frame, as a `StereoCamera` begins them."""
        disparities, labels = error_stream(self._seed, self._camera).spawn(2)
        return PictureErrors.begin(self._stereo, self._strengths, disparities, labels)

    def _numbers(self, *which: int) -> list[np.random.Generator]:
        return np.random.default_rng([*which, *self._seed]).spawn(2)


def of_log(log: LogReader, camera: str) -> TownErrors:
    """Read the plan of a recording, as `redrawing_of` does."""
    try:
        plan = json.loads(log.attachments()["plan.json"])
        is_current = digest_value({"plan": plan, "version": RENDER_VERSION}) == log.scene.source_digest
        seed, stereo, strengths = tuple(map(int, plan["seed"])), plan["stereo"], _strengths(plan.get("drawn"))
    except (ValueError, KeyError, TypeError) as error:
        raise LogError(f"is not the plan of a recording: {error}", path=log.path, field="plan.json") from error
    if not is_current:
        fault = (
            "the log is not what this version renders from it (older, or with other labels), so nothing is drawn again"
        )
        raise UnknownTruthError(fault, path=log.path, field="plan.json")
    if stereo == "matched":
        fault = "its disparity comes from matching pictures, and such errors cannot be drawn again"
        raise UnknownTruthError(fault, path=log.path, field="plan.json")
    return TownErrors(seed, stereo, strengths, camera)


def _strengths(drawn: Mapping[str, Any] | None) -> Strengths:
    """Read how strong the errors of a recording are, where they vary; else they are the usual ones."""
    if drawn is None:
        return Strengths()
    return Strengths(DisparityNoise(**drawn["disparity"]), LabelNoise(**drawn["label"]))


def _with_errors(errors: PictureErrors, exact: Pictures, frames: int) -> Pictures:
    label, disparity_px = errors.add(exact.label, decoded_disparity(exact.disparity), frames)
    return Pictures(label, coded_disparity(disparity_px))
