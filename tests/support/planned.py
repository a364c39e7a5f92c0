"""Planned windows, written and read one by one."""

import numpy as np

from semgrid_eval.windows.plan import Windows


def planned(*windows: tuple[int, tuple[int, ...], int]) -> Windows:
    """Plan windows, each by its recording, the frames of its inputs and that of its target."""
    recordings, inputs, targets = zip(*windows, strict=True)
    frames = np.column_stack([np.array(inputs, np.int32), np.array(targets, np.int32)])
    return Windows(np.array(recordings, np.int32), frames)


def listed(windows: Windows) -> list[tuple[int, tuple[int, ...], int]]:
    """List windows as `planned` takes them."""
    rows = zip(windows.recording.tolist(), windows.frames.tolist(), strict=True)
    return [(recording, tuple(frames[:-1]), frames[-1]) for recording, frames in rows]
