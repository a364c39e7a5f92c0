"""Draw windows of a row as one PNG: older input, newer input, target with M in white, prediction.

Example: python tools/window_picture.py demo/run ED-DC docs/demo.png
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from semgrid_eval.classes import DEFAULT_CLASSES, MASK_COLOUR
from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file
from semgrid_eval.scores.results import read_predictions, read_result, read_run, read_windows, result_folder

WINDOWS = 4
SCALE = 2
GAP_PX = 6


def tile(grid: np.ndarray, mask: np.ndarray | None = None) -> Image.Image:
    """Draw one grid (H, W), each cell `SCALE` pixels wide."""
    colours = DEFAULT_CLASSES.palette(safe=True)[grid]
    picture = Image.fromarray(
        colours if mask is None else np.where(mask[..., None], MASK_COLOUR, colours).astype(np.uint8)
    )
    return picture.resize((picture.width * SCALE, picture.height * SCALE), Image.Resampling.NEAREST)


def draw(run: Path, row_name: str) -> Image.Image:
    """Draw evenly spread windows of a row, one below the other."""
    rows = {row.name: row for row in read_run(run).rows}
    if row_name not in rows or not rows[row_name].results:
        raise InputError(f"has no finished row {row_name!r}, only {', '.join(rows)}", path=run)
    folder = result_folder(run, rows[row_name].results[0])
    windows = read_windows(run, read_result(folder).windows_id)
    prediction = read_predictions(folder)["prediction"]
    lines = [
        [
            *(tile(grid) for grid in windows["inputs"][n, 0]),
            tile(windows["target"][n], windows["mask"][n]),
            tile(prediction[n]),
        ]
        for n in np.linspace(0, len(prediction) - 1, WINDOWS).astype(int)
    ]
    step = lines[0][0].width + GAP_PX
    sheet = Image.new("RGB", (step * len(lines[0]) - GAP_PX, step * len(lines) - GAP_PX), "white")
    for i, line in enumerate(lines):
        for j, picture in enumerate(line):
            sheet.paste(picture, (j * step, i * step))
    return sheet


def main(run: str, row: str, out: str) -> None:
    """Draw and save."""
    with atomic_file(Path(out)) as stream:
        draw(Path(run), row).save(stream, "PNG", optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
