"""Recordings with colour images whose labels can be told by hand: red is road, blue is car."""

import io
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from support.driving import driving

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import Moment, Recording

TRAIN_COLOURS = {0: (1.0, 0.0, 0.0), 13: (0.0, 0.0, 1.0)}


def coloured(recording: Recording | None = None, *, without: tuple[int, ...] = ()) -> Recording:
    """Give every frame a colour image of random red and blue pixels, but for the moments `without`."""
    recording = recording or driving(frames=4)

    def moments():
        for number, moment in enumerate(recording.moments()):
            yield _painted(moment, None if number in without else number)

    return replace(recording, moments=moments)


def expected_labels(number: int, camera: str = "front", shape: tuple[int, int] = (32, 64)) -> NDArray[np.uint8]:
    """Return the label ids of a moment's image."""
    red = np.random.default_rng([number, *camera.encode()]).random(shape) < 0.5
    return np.where(red, LABEL_ID["road"], LABEL_ID["car"]).astype(np.uint8)


def _painted(moment: Moment, number: int | None) -> Moment:
    frames = {camera: replace(frame, image_file=_image(camera, number)) for camera, frame in moment.cameras.items()}
    return replace(moment, cameras=frames)


def _image(camera: str, number: int | None) -> bytes | None:
    if number is None:
        return None
    red = expected_labels(number, camera) == LABEL_ID["road"]
    colours = np.where(red[..., np.newaxis], (255, 0, 0), (0, 0, 255)).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(colours).save(stream, "PNG")
    return stream.getvalue()
