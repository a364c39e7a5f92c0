"""Settings of the whole suite: the same examples every time, no clocks."""

import sys

import pytest
from hypothesis import settings

from semgrid_eval.ray_executor import keep_to_this_machine

keep_to_this_machine()  # before any module of tests imports Ray
settings.register_profile("suite", deadline=None, derandomize=True, database=None)
settings.load_profile("suite")


@pytest.fixture(autouse=True)
def same_threads_after():
    """Give numeric libraries their numbers of threads back, which commands set, where they are imported at all."""
    torch, cv2 = sys.modules.get("torch"), sys.modules.get("cv2")
    of_torch, of_opencv = torch and torch.get_num_threads(), cv2 and cv2.getNumThreads()
    yield
    if torch:
        torch.set_num_threads(of_torch)
    if cv2:
        cv2.setNumThreads(of_opencv)
