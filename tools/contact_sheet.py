"""Draw a contact sheet of logs: camera image, labels, disparity and grid of one frame of some of them.

Example: python tools/contact_sheet.py demo/logs docs/town.jpg
"""

import io
import sys
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_eval.classes import DEFAULT_CLASSES
from semgrid_eval.files import atomic_file
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import label_palette
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.recording.png import decode_gray

LOGS = 6
HEIGHT_PX = 192
NEAR_PX = 0.05  # disparity, as a share of the image's width, that is drawn as near as can be
JPEG_QUALITY = 82

Picture = NDArray[np.uint8]


def draw_log(path: Path) -> Picture:
    """Draw the first frame of a log and its grid, side by side: (height, width, 3) sRGB."""
    with LogReader(path) as log:
        frame = next(log.frames(log.scene.cameras[0], images=True))
    grid = DEFAULT_CLASSES.palette()[build_log(path, GridConfig())[0].grids[0, 0]]
    image = np.asarray(Image.open(io.BytesIO(frame.image_file or b"")).convert("RGB"))
    label = label_palette()[decode_gray(frame.label_png or b"", bit_depth=8)]
    disparity = decode_gray(frame.disparity_png or b"", bit_depth=16)
    near = np.clip(disparity / 256 / (NEAR_PX * disparity.shape[1]), 0, 1)
    colours = cv2.cvtColor(cv2.applyColorMap((near * 255).astype(np.uint8), cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB)
    colours[disparity == 0] = 0
    return np.hstack([_scaled(part) for part in (image, label, colours, grid)])


def _scaled(picture: Picture) -> Picture:
    width = round(picture.shape[1] * HEIGHT_PX / picture.shape[0])
    coarse = picture.shape[0] < HEIGHT_PX
    return np.asarray(
        cv2.resize(picture, (width, HEIGHT_PX), interpolation=cv2.INTER_NEAREST if coarse else cv2.INTER_AREA)
    )


def main(logs: str, out: str) -> None:
    """Draw logs spread evenly over the folder, one below the other."""
    found = find_logs(Path(logs))
    chosen = islice(found, 0, None, max(1, len(found) // LOGS))
    sheet = np.vstack([draw_log(path) for path in islice(chosen, LOGS)])
    with atomic_file(Path(out)) as stream:
        Image.fromarray(sheet).save(stream, "JPEG", quality=JPEG_QUALITY)


if __name__ == "__main__":
    main(*sys.argv[1:])
