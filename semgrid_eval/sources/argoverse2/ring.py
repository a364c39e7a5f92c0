"""The ring cameras of a log: single cameras all around the vehicle, whose images are kept as they come."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sources.argoverse2.cameras import Camera, Look, calibration_of, cameras_folder, images_of, read_camera

_OPTION = "--ring-every"
Images = dict[int, Path]
"""Files by time."""


def ring_images(log: Path, every: int) -> dict[str, Images]:
    """Find every so many images of each ring camera, from the first on, by its name; 0: none."""
    names = sorted(folder.name for folder in cameras_folder(log).glob("ring_*")) if every else []
    found = {name: dict(sorted(images_of(log, name).items())[::every]) for name in names}
    return {name: images for name, images in found.items() if images}


def ring_look(log: Path, name: str, images: Mapping[int, Path]) -> Look:
    """Return what a ring camera of a log sees in images.

    Raises:
        InputError: a file, the camera in it or a column is missing, or a value is impossible.
    """
    camera = read_camera(log, name, _OPTION)
    calibration = calibration_of(camera.matrix, camera.ego_from_optical, None)
    return Look(calibration, {stamp_ns: partial(_frame, camera, stamp_ns, path) for stamp_ns, path in images.items()})


def _frame(camera: Camera, stamp_ns: int, path: Path) -> CameraFrame:
    return CameraFrame(stamp_ns, image_file=camera.read_image(path), disparity_png=None, label_png=None)
