"""Pieces of work for executors, in a module that other processes can import."""

import os
import time

from semgrid_eval.executors import NoRoomError
from semgrid_eval.files import atomic_file


def square_or_die(value):
    if value == 3:
        os._exit(1)
    return value * value, os.getpid()


def fit_alone(folder, item):
    """Find room at the second time of asking, or never."""
    if item == "never" or not (folder / item).exists():
        (folder / item).touch()
        raise NoRoomError("out of memory")
    return item


def environment(_item):
    return dict(os.environ)


def threads_of_libraries(_item):
    import cv2
    import numba
    import torch

    return cv2.getNumThreads(), numba.get_num_threads(), torch.get_num_threads()


def write_a_minute(path):
    """Tell on the standard output that this file has begun; only the first one ends before a test does."""
    with atomic_file(path):
        os.write(1, f"{path.name}\n".encode())
        end_s = time.monotonic() + 60
        while time.monotonic() < end_s and not (path.name == "first" and (path.parent / "go on").exists()):
            time.sleep(0.02)
