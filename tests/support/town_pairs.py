"""Drives in a simulated town whose disparity was matched, with the pairs of gray images that it was matched from."""

from collections.abc import Iterator
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from support.bags import RecordingBag, Variant

from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import Moment, Recording
from semgrid_eval.sources.matching import SemiGlobalMatching
from semgrid_eval.sources.town import stereo_camera
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording


class _Watched(SemiGlobalMatching):
    """Keeps the last pair, as sensors with noise expose it."""

    pair: tuple[np.ndarray, np.ndarray]

    def disparity_px(self, left, right):
        _Watched.pair = left, right
        return super().disparity_px(left, right)


def matched_drive(plan: RecordingPlan) -> tuple[Recording, RecordingBag]:
    """Render a drive whose disparity is matched: its recording, and a bag of the pairs, as wide as its images."""
    assert plan.stereo == "matched"
    recording = render_recording(plan)
    with patch.object(stereo_camera, "SemiGlobalMatching", _Watched):
        seen = list(_with_pairs(recording, plan.width_px))
    moments = [moment for moment, _ in seen]
    rights = {moment.stamp_ns: right for moment, right in seen}
    kept = replace(recording, moments=lambda: iter(moments))
    return kept, RecordingBag(kept, Variant(image="mono8", depth="right"), rights)


def _with_pairs(recording: Recording, width: int) -> Iterator[tuple[Moment, np.ndarray]]:
    """Iterate over moments whose images are those of the left camera, and the images of the right one."""
    for moment in recording.moments():
        left, right = (np.ascontiguousarray(each[:, -width:]) for each in _Watched.pair)
        cameras = {name: replace(each, image_file=encode_gray(left)) for name, each in moment.cameras.items()}
        yield replace(moment, cameras=cameras), right
