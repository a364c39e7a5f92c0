"""Measures the way from pictures to logs and back, beside copying, decoding and the MCAP library."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from semgrid_eval.bench.material import Material, pictures_of
from semgrid_eval.bench.measurement import Measurement, seconds_passed, times_as_fast, wall_s
from semgrid_eval.bench.rivals import decode_by_opencv, read_by_library
from semgrid_eval.log.check import check_log
from semgrid_eval.log.convert import Work
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.log.topics import PICTURE_FIELDS
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.sources.cityscapes.source import CityscapesOptions
from semgrid_eval.sources.cityscapes.tree import convert_cityscapes

_MEGABYTE = 1e6


def measure_conversion(material: Material) -> Iterator[Measurement]:
    """Convert a Cityscapes tree, against copying it, and with several workers."""
    settings, tree, folder = material.settings, material.tree, material.folder / "converted"
    megabytes = sum(path.stat().st_size for path in tree.rglob("*") if path.is_file()) / _MEGABYTE
    work_on = partial(_convert_anew, tree, folder)
    alone_s = wall_s(work_on, settings.repeats)
    yield Measurement(f"tree of {megabytes:.0f} MB converted", megabytes / alone_s, "MB/s")
    copied = times_as_fast(partial(_copy_anew, tree, folder), work_on, settings.repeats)
    yield Measurement("converted, against copying it", copied, "times its time", at_most=1.3)
    together = partial(_convert_anew, tree, folder, workers=settings.workers)
    gain = times_as_fast(together, work_on, settings.repeats, clock=seconds_passed)
    yield Measurement(f"converted by {settings.workers} workers", gain, "times", at_least=1.7)


def measure_logs(material: Material) -> Iterator[Measurement]:
    """Write logs from frames in memory, read all of them and check them; against decoding, and the MCAP library."""
    for size_px in material.settings.pictures_px:
        yield from _measure_log(material, size_px)


def _measure_log(material: Material, size_px: ImageSize) -> Iterator[Measurement]:
    repeats, path, written = material.settings.repeats, material.log(size_px), material.folder / "written.mcap"
    megabytes, recording = path.stat().st_size / _MEGABYTE, material.recording(size_px)
    looked_through = replace(recording, encoded_here=False)  # as if others had made its pictures
    write, read, check = partial(write_log, recording, written), partial(_read, path), partial(check_log, path)
    library = partial(read_by_library, path)
    decode = partial(decode_by_opencv, pictures_of(path, PICTURE_FIELDS))
    rates: tuple[tuple[str, Callable[[], object], float | None], ...] = (
        ("written", write, 400.0),
        ("written, pictures looked through", partial(write_log, looked_through, written), None),
        ("read", read, 600.0),
        ("read by the MCAP library", library, None),
        ("checked", check, None),
    )
    log = f"{size_px}, {megabytes:.1f} MB"
    for what, work, at_least in rates:
        yield Measurement(f"{log}, {what}", megabytes / wall_s(work, repeats), "MB/s", at_least=at_least)
    yield Measurement(f"{log}, read, against the MCAP library", times_as_fast(read, library, repeats), "times")
    gain = times_as_fast(check, decode, repeats)
    yield Measurement(f"{log}, checked, against decoding", gain, "times", at_least=1.0)


def _convert_anew(tree: Path, folder: Path, *, workers: int = 1) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    convert_cityscapes(CityscapesOptions(src=tree), folder, Work(workers=workers))


def _copy_anew(tree: Path, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(tree, folder)


def _read(path: Path) -> None:
    for _ in read_recording(path).moments():
        pass
