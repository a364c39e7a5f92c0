"""Settings of the whole suite: the same examples every time, no clocks."""

import pytest
from hypothesis import settings

from semgrid_eval.ray_executor import keep_to_this_machine

keep_to_this_machine()  # before any module of tests imports Ray
settings.register_profile("suite", deadline=None, derandomize=True, database=None)
settings.load_profile("suite")


@pytest.fixture
def same_threads_after():
    """Give numeric libraries their numbers of threads back after a test that sets them."""
    import cv2
    import torch

    of_torch, of_opencv = torch.get_num_threads(), cv2.getNumThreads()
    yield
    torch.set_num_threads(of_torch)
    cv2.setNumThreads(of_opencv)
