"""`convert kitti`: sequences in KITTI's or SemanticKITTI's layout as logs.

SRC/sequences/<NN>/calib.txt            projections P2, P3 and the scanner's place, Tr
SRC/sequences/<NN>/times.txt            seconds, a line for each frame
SRC/sequences/<NN>/poses.txt            of camera 0, or SRC/poses/<NN>.txt
SRC/sequences/<NN>/velodyne/000000.bin  x, y, z, reflectance, float32
SRC/sequences/<NN>/labels/000000.label  SemanticKITTI's, where present
SRC/sequences/<NN>/image_2, image_3     rectified colour images, left and right; the left ones may be alone
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs, how_to_label
from semgrid_eval.sources.kitti.sequence import KittiSequence, Part, camera0_at
from semgrid_eval.sources.kitti.source import KittiOptions
from semgrid_eval.sources.parts import count_of_parts, equal_parts

_LEAST_FRAMES = 2
_NUMBER = re.compile(r"[0-9]{6}")
_LEFT_MISSING = "right images (image_3) without left ones (image_2)"


def convert_kitti(options: KittiOptions, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of sequences; those that are up to date stay as they are.

    Raises:
        InputError: there is no such sequence, or the disk is full.
    """
    sequences, jobs = [], []
    for folder in _folders(options):
        try:
            sequence = _sequence(folder, options)
            parts = list(_parts(sequence, options))
        except InputError as error:
            jobs.append(ConversionJob.failing(folder.name, options.split, str(error)))
            continue
        sequences.append(sequence)
        jobs += [ConversionJob(each.name, each.split, each.digest, each.recording) for each in parts]
    summary = convert_jobs(jobs, out, work)
    summary.remark = _remark(sequences, out)
    return summary


def _folders(options: KittiOptions) -> list[Path]:
    folder = options.src / "sequences"
    there = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    if not there:
        raise InputError("holds no folder of a sequence" if folder.is_dir() else "is not a folder", path=folder)
    for name in options.sequence:
        if name not in {path.name for path in there}:
            known = ", ".join(path.name for path in there)
            raise InputError(f"{name} is not one of: {known}", path=folder, field="sequence")
    return [path for path in there if path.name in options.sequence or not options.sequence]


def _sequence(folder: Path, options: KittiOptions) -> KittiSequence:
    """See what a sequence has, without reading any file."""
    scans, left, right = (_numbers(folder, channel) for channel in ("velodyne", "image_2", "image_3"))
    channels = [name for name in ("velodyne", "labels") if scans and (folder / name).is_dir()]
    channels += ["image_2"] * bool(left) + ["image_3"] * bool(left and right)
    numbers = scans or (left if right else [])
    if not numbers:
        fault = f"holds {_LEFT_MISSING}, and no scans" if right else "holds neither scans nor pairs of images"
        raise InputError(fault, path=folder)
    own = folder / "poses.txt"
    other = options.src / "poses" / f"{folder.name}.txt"
    poses = other if other.is_file() and not own.is_file() else own
    return KittiSequence(folder, poses, tuple(numbers), tuple(channels), camera0_at(options.camera_at_m))


def _numbers(folder: Path, channel: str) -> list[int]:
    found = (folder / channel).glob("*.bin" if channel == "velodyne" else "*.png")
    return sorted(int(path.stem) for path in found if _NUMBER.fullmatch(path.stem))


def _parts(sequence: KittiSequence, options: KittiOptions) -> Iterator[Part]:
    """Cut a sequence into equal parts; a frame that is missing in between fails the part that it belongs to."""
    first, end = sequence.numbers[0], sequence.numbers[-1] + 1
    if end - first < _LEAST_FRAMES:
        raise InputError("has a single frame; motion needs more", path=sequence.folder)
    span_ns = sequence.stamps_ns[end - 1] - sequence.stamps_ns[first]
    most = (end - first) // _LEAST_FRAMES
    for start, stop in equal_parts(first, end, min(most, count_of_parts(span_ns, options.recording_s))):
        yield Part(sequence, start, stop, options.split)


def _remark(sequences: list[KittiSequence], out: Path) -> str:
    """Say in one line what is not there."""
    names = defaultdict(list)
    for sequence in sequences:
        for what in _lacks(sequence):
            names[what].append(sequence.folder.name)
    parts = [f"{what}: {', '.join(found)}" for what, found in names.items()]
    if seen := [each.folder.name for each in sequences if "image_2" in each.channels]:
        parts.append(f"no labels for the cameras of {', '.join(seen)}: {how_to_label(out)}")
    return "; ".join(parts)


def _lacks(sequence: KittiSequence) -> Iterator[str]:
    """Name what a sequence lacks, but for labels of images, which none has."""
    if "velodyne" in sequence.channels and "labels" not in sequence.channels:
        yield "scans without labels, which a camera has to colour"
    if "image_2" not in sequence.channels:
        alone = _numbers(sequence.folder, "image_3")
        yield f"{_LEFT_MISSING}, so no camera" if alone else "no images, so no camera"
    elif "image_3" not in sequence.channels:
        yield "no right images, so no disparity"
