"""What is measured: a town, recordings and a log of it, and windows, each made when it is first asked for."""

import math
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from semgrid_eval.bench.measurement import Settings
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.log.store import write_log
from semgrid_eval.models.model import Given
from semgrid_eval.progress import silent
from semgrid_eval.recording.types import Recording
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.recordings import RecordingPlan, SyntheticConfig, plan_recordings, render_recording
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

_CELLS, _CELL_M, _FRAMES, _FRAME_NS = 128, 100 / 128, 30, 58_823_529
_COARSE = 8  # cells of a random patch
GIVEN = Given(("full",), WindowConfig().inputs, _CELLS, _CELLS, _CELL_M, translate=True)
"""What a row of random windows gives its model."""


class Material:
    """Inputs of the measurements.

    Args:
        folder: for towns and logs.
        settings: how large everything is.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
        self.folder = folder
        self.settings = settings

    def plan(self, stereo: Stereo, width_px: int, height_px: int) -> RecordingPlan:
        """Plan a recording in the town, which is built once; the size is scaled as the settings say.

        Raises:
            InputError: SUMO failed.
            MissingExtraError: SUMO or Embree is not installed.
        """
        scale = self.settings.scale
        config = SyntheticConfig(
            recordings=1,
            towns=1,
            val_share=0.0,
            stereo=stereo,
            width=round(width_px * scale),
            height=round(height_px * scale),
            town_size_m=self.settings.town_size_m,
            duration_s=self.settings.duration_s,
        )
        return plan_recordings(config, self.folder / "towns", silent)[0]

    @cached_property
    def recording(self) -> Recording:
        """A rendered recording of modelled stereo, its frames in memory."""
        recording = render_recording(self.plan("modelled", 512, 256))
        moments = tuple(recording.moments())
        return replace(recording, moments=lambda: iter(moments))

    @cached_property
    def log(self) -> Path:
        """The log of that recording."""
        path = self.folder / "recording.mcap"
        write_log(self.recording, path)
        return path


@cache
def random_windows(count: int = 80) -> WindowSet:
    """Make windows over random coarse grids; how long a network takes does not depend on what they show."""
    random = np.random.default_rng(0)
    config = WindowConfig()
    recordings = math.ceil(count / (_FRAMES - config.reach_frames))
    data = stack_recordings([_random_recording(str(number), random) for number in range(recordings)], cell_m=_CELL_M)
    return select_windows(data, training_windows(data.frame_counts, config).windows[:count], sensors=["full"])


def _random_recording(name: str, random: np.random.Generator) -> GridRecording:
    size = _CELLS // _COARSE
    coarse = random.integers(0, CLASS_COUNT, (1, _FRAMES, size, size), dtype=np.uint8)
    return GridRecording(
        name=name,
        log="",
        digest=name,
        split="train",
        dataset="random",
        sensors=("full",),
        target="full",
        stamps_ns=np.arange(_FRAMES, dtype=np.int64) * _FRAME_NS,
        grids=coarse.repeat(_COARSE, axis=2).repeat(_COARSE, axis=3),
        position_m=np.cumsum(random.normal(0.3, 0.1, (_FRAMES, 2)), axis=0),
        yaw_rad=np.zeros(_FRAMES),
    )
