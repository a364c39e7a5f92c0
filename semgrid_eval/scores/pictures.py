"""Small pictures of the frames that windows use, kept in a run so that a report can show them without the logs.

`RUN/pictures/<key>.npz` holds those of one camera of one log, `<key>` being the digest of both: `stamps_ns` (K,) int64,
ascending; the files of all images, then of all labels, one after the other as `images` and `labels` uint8, and where
each ends as `image_ends` and `label_ends` (K,) int64. An empty file stands for a picture that the log does not have.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import ResultError
from semgrid_eval.files import digest_value

FORMAT_VERSION = 1
_ARRAYS = ("stamps_ns", "images", "image_ends", "labels", "label_ends")


@dataclass(frozen=True)
class FramePictures:
    """The small pictures of one frame as files; empty where the log has none.

    Args:
        image: the camera's image as WebP.
        label: Cityscapes label ids as palette PNG.
    """

    image: bytes = b""
    label: bytes = b""


def pictures_file(run: Path, log_digest: str, camera: str | None) -> Path:
    """Where the pictures of a camera of a log lie; None stands for a log's only camera."""
    key = {"log": log_digest, "camera": camera, "format": FORMAT_VERSION}
    return run / "pictures" / f"{digest_value(key)}.npz"


def write_pictures(path: Path, pictures: Mapping[int, FramePictures]) -> None:
    """Write the pictures of frames by their stamps (ns) atomically, equal ones giving equal bytes.

    Raises:
        InputError: the folder cannot be written to.
    """
    stamps_ns = sorted(pictures)
    images, image_ends = _joined([pictures[stamp].image for stamp in stamps_ns])
    labels, label_ends = _joined([pictures[stamp].label for stamp in stamps_ns])
    stamps = np.array(stamps_ns, np.int64)
    write_arrays(path, dict(zip(_ARRAYS, (stamps, images, image_ends, labels, label_ends), strict=True)))


def read_pictures(path: Path) -> dict[int, FramePictures]:
    """Read the pictures of frames by their stamps (ns).

    Raises:
        ResultError: they are missing or malformed.
    """
    arrays = read_arrays(path, _ARRAYS)
    stamps_ns = _whole_numbers(arrays["stamps_ns"], path, "stamps_ns")
    images = _cut(arrays["images"], arrays["image_ends"], path, "images")
    labels = _cut(arrays["labels"], arrays["label_ends"], path, "labels")
    if not len(stamps_ns) == len(images) == len(labels):
        raise ResultError(f"{len(stamps_ns)} frames have {len(images)} images and {len(labels)} labels", path=path)
    return {stamp: FramePictures(*files) for stamp, *files in zip(stamps_ns, images, labels, strict=True)}


def _joined(files: Sequence[bytes]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    return np.frombuffer(b"".join(files), np.uint8), np.array(list(accumulate(map(len, files))), np.int64)


def _cut(data: NDArray[Any], ends: NDArray[Any], path: Path, name: str) -> list[bytes]:
    places = [0, *_whole_numbers(ends, path, name)]
    if data.dtype != np.uint8 or data.ndim != 1 or places != sorted(places) or places[-1] != len(data):
        raise ResultError("is not one file after the other", path=path, field=name)
    return [data[start:end].tobytes() for start, end in pairwise(places)]


def _whole_numbers(values: NDArray[Any], path: Path, name: str) -> list[int]:
    if values.ndim != 1 or values.dtype != np.int64:
        raise ResultError(f"has shape {values.shape}, type {values.dtype}", path=path, field=name)
    numbers: list[int] = values.tolist()
    return numbers
