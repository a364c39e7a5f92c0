"""Good logs of a toy street with their grids, and rows that are run on them."""

from pathlib import Path

from support.bad.case import run
from support.toy_world import street

from semgrid_eval.log.store import write_log

WINDOW = "window: {step_frames: 3, target_frame: 8}"
RUN = "run bad.yaml --logs logs --out out --grids grids --no-pictures --own-models here --device cpu --workers 1"


def whole() -> None:
    """Write a log of nine frames for each split, and make their grids."""
    for place, split in enumerate(("train", "val")):
        recording = street(place, frames=9, speed_mps=8 + place, noise_px=0.05).recording(f"toy{place}", split)
        write_log(recording, Path("logs", split, f"toy{place}.mcap"))
    code, told = run("grids logs grids --workers 1")
    assert code == 0, told


def matrix(row: str) -> bytes:
    """Return a matrix of one row, with windows for these logs if it has none of its own."""
    window = "" if "window:" in row else f", {WINDOW}"
    return f"rows: [{{name: a, {row}{window}}}]\n".encode()
