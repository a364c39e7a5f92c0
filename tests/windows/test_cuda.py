"""Windows on a CUDA device: inputs, shifts, masks, targets and planes are those of the CPU, cell by cell."""

import pytest
import torch
from support.cuda import CPU, CUDA, NEEDS_CUDA, windows_of
from support.recordings import random_recording

from semgrid_eval.models.network import autocast, input_planes
from semgrid_eval.windows.grids import shift_grids

pytestmark = NEEDS_CUDA
SENSORS = ("full", "left")
PARTS = ("past", "shift_cells", "lead_s", "target", "mask")


@pytest.mark.parametrize("translate", [True, False])
def test_batches_are_those_of_the_cpu(translate):
    here = windows_of([random_recording(seed, size=32, sensors=SENSORS) for seed in range(3)], translate=translate)
    there = here.to(CUDA)
    assert there.digest() == here.digest()
    for chosen in (torch.tensor([3, 0, 3, 40]), slice(10, 20)):
        moved = chosen.to(CUDA) if isinstance(chosen, torch.Tensor) else chosen
        mine, theirs = here.batch(chosen), there.batch(moved)
        assert theirs.mask.any()
        assert all(torch.equal(getattr(mine, name), getattr(theirs, name).cpu()) for name in PARTS)


def test_content_moves_as_on_the_cpu():
    generator = torch.Generator().manual_seed(0)
    grids = torch.randint(0, 10, (50, 3, 32, 48), generator=generator, dtype=torch.uint8)
    shift_cells = torch.randint(-60, 60, (50, 3, 2), generator=generator)
    assert torch.equal(shift_grids(grids, shift_cells), shift_grids(grids.to(CUDA), shift_cells.to(CUDA)).cpu())


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_planes_are_those_of_the_cpu(dtype):
    past = torch.randint(0, 10, (4, 2, 2, 32, 32), generator=torch.Generator().manual_seed(0), dtype=torch.uint8)
    planes = {}
    for device in (CPU, CUDA):
        with autocast(device, dtype):
            planes[device] = input_planes(past.to(device))
    assert planes[CUDA].dtype is dtype
    assert planes[CUDA].is_contiguous(memory_format=torch.channels_last)
    assert torch.equal(planes[CPU], planes[CUDA].cpu())
