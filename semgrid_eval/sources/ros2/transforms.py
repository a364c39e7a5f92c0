"""Where frames are in the vehicle, from the transforms in a bag."""

from collections import deque
from typing import Any

import numpy as np

from semgrid_eval import geometry
from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3

_STILL_M, _STILL = 1e-3, 1e-3  # how much a link may change, its rotation in elements of the matrix (about radians)


class Transforms:
    """The links between frames that a bag tells; each is what was heard first, and some are known to move.

    Of topics, the one with the lowest rank counts, whenever it is heard.
    """

    def __init__(self) -> None:
        self._links: dict[tuple[str, str], SE3] = {}
        self._ranks: dict[tuple[str, str], int] = {}
        self._moving: set[tuple[str, str]] = set()

    def add(self, message: Any, rank: int = 0) -> None:  # noqa: ANN401 - a class that rosbags makes
        """Take in a TFMessage of a topic of that rank."""
        for each in message.transforms:
            key = (_plain(each.header.frame_id), _plain(each.child_frame_id))
            known_by = self._ranks.get(key)
            if known_by is None or rank < known_by:
                self._links[key], self._ranks[key] = _se3(each.transform), rank
                self._moving.discard(key)
            elif rank == known_by and not _same(self._links[key], _se3(each.transform)):
                self._moving.add(key)

    def lookup(self, parent: str, child: str) -> SE3:
        """Return parent_from_child.

        Raises:
            InputError: nothing links the frames, or what does moves.
        """
        path = self._path(_plain(parent), _plain(child))
        if path is None:
            known = ", ".join(f"{one} -> {other}" for one, other in sorted(self._links)) or "none"
            raise InputError(f"no link from {parent} to {child}; there are: {known}", field="tf")
        result = SE3(np.eye(3), np.zeros(3))
        for key, forward in path:
            if key in self._moving:
                raise InputError(f"the link {key[0]} -> {key[1]} moves; a sensor has to be fixed", field="tf")
            result = result @ (self._links[key] if forward else self._links[key].inverse())
        return result

    def has(self, parent: str, child: str) -> bool:
        """Tell whether `lookup` finds something."""
        try:
            self.lookup(parent, child)
        except InputError:
            return False
        return True

    @property
    def frames(self) -> set[str]:
        """The names of all frames."""
        return {name for key in self._links for name in key}

    def _path(self, parent: str, child: str) -> list[tuple[tuple[str, str], bool]] | None:
        """Find the shortest way along links, each with whether it leads from parent to child."""
        ways: dict[str, list[tuple[tuple[str, str], bool]]] = {parent: []}
        waiting = deque([parent])
        while waiting and child not in ways:
            here = waiting.popleft()
            for key in self._links:
                for start, end, forward in ((*key, True), (*key[::-1], False)):
                    if start == here and end not in ways:
                        ways[end] = [*ways[here], (key, forward)]
                        waiting.append(end)
        return ways.get(child)


def rotation_of(quaternion: Any) -> np.ndarray[Any, np.dtype[np.float64]]:  # noqa: ANN401
    """Return the rotation (3, 3) of a quaternion, which need not be normalised.

    Raises:
        InputError: it is zero or not finite.
    """
    x, y, z, w = (float(getattr(quaternion, name)) for name in "xyzw")
    try:
        return geometry.rotation_of((x, y, z, w))
    except ValueError as error:
        raise InputError(str(error), field="quaternion") from error


def _se3(transform: Any) -> SE3:  # noqa: ANN401
    place = transform.translation
    return SE3(rotation_of(transform.rotation), np.array([place.x, place.y, place.z], np.float64))


def _same(one: SE3, other: SE3) -> bool:
    apart_m = np.abs(one.translation_m - other.translation_m).max()
    return bool(apart_m <= _STILL_M and np.abs(one.rotation - other.rotation).max() <= _STILL)


def _plain(frame: str) -> str:
    return frame.removeprefix("/")
