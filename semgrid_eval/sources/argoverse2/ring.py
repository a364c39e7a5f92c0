"""The ring cameras of a log: single cameras all around the vehicle, whose images are kept as they come."""

from functools import partial
from pathlib import Path

from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.argoverse2.cameras import (
    Camera,
    Images,
    Look,
    cameras_folder,
    images_of,
    read_camera,
)

OPTION = "--ring-every"


def ring_images(log: Path) -> dict[str, Images]:
    """Find the images of each ring camera by its name."""
    names = sorted(folder.name for folder in cameras_folder(log).glob("ring_*"))
    return {name: images_of(log, name) for name in names}


def ring_look(log: Path, name: str, images: Images) -> Look:
    """Return what a ring camera of a log sees in images.

    Raises:
        InputError: a file, the camera in it or a column is missing, or a value is impossible.
    """
    camera = read_camera(log, name, OPTION)
    calibration = CameraCalibration.of(camera.matrix, camera.ego_from_optical, None)
    return Look(calibration, {stamp_ns: partial(_frame, camera, stamp_ns, path) for stamp_ns, path in images.items()})


def _frame(camera: Camera, stamp_ns: int, path: Path) -> CameraFrame:
    return CameraFrame(stamp_ns, image_file=camera.read_image(path), disparity_png=None, label_png=None)
