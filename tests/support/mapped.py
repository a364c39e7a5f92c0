"""Where a tensor's memory comes from, as Linux tells it."""

import sys
from pathlib import Path

import pytest
from torch import Tensor

NEEDS_PROC = pytest.mark.skipif(sys.platform != "linux", reason="no other system tells what memory is mapped from")


def file_of(tensor: Tensor) -> str:
    """Return the path of the file that a tensor's memory is mapped from; empty where it is anonymous."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, *_, inode, path = (*line.split(maxsplit=5), "")[:6]
        first, end = (int(part, 16) for part in span.split("-"))
        if first <= tensor.data_ptr() < end:
            return path if inode != "0" else ""
    raise AssertionError("the tensor has no memory")
