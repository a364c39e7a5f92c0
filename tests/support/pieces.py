"""Pieces of work for executors, in a module that other processes can import."""

import os

from semgrid_eval.executors import NoRoomError


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
