"""A lead in milliseconds as frames of the recordings that are scored."""

from dataclasses import replace

import numpy as np
import pytest
from support.recordings import FRAME_NS, random_recording

from semgrid_eval.errors import InputError
from semgrid_eval.runs.selection import wanted_lead
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig


def at_rate(name, seed, period_ns, frames=9):
    made = random_recording(seed, frames=frames)
    return replace(made, name=name, stamps_ns=np.arange(frames, dtype=np.int64) * period_ns)


def test_a_lead_has_to_be_as_many_frames_of_all_recordings():
    lead = WindowConfig(lead_ms=120.0, target_frame=None)
    alike = [at_rate("quick", 1, FRAME_NS), at_rate("a bit slower", 2, FRAME_NS + 1_000_000)]
    assert wanted_lead(lead, stack_recordings(alike, cell_m=1.0)) == (2,)
    alone = at_rate("of one frame", 4, FRAME_NS, frames=1)
    assert wanted_lead(lead, stack_recordings([*alike, alone], cell_m=1.0)) == (2,), "it has no rate"
    other = at_rate("slow", 3, 100_000_000)
    with pytest.raises(InputError, match="lead_ms: 120 ms are 1 frame of slow and 2 frames of a bit slower; score"):
        wanted_lead(lead, stack_recordings([*alike, other], cell_m=1.0))
    assert wanted_lead(WindowConfig(), stack_recordings([*alike, other], cell_m=1.0)) == (), "steps are frames"
