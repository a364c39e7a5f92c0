"""The Cityscapes sequence tree as a source of recordings.

    SRC/leftImg8bit_sequence/<split>/<city>/<frame>_leftImg8bit.png    8 bit
    SRC/disparity_sequence/<split>/<city>/<frame>_disparity.png        16 bit gray, d_px = (p - 1) / 256
    SRC/vehicle_sequence/<split>/<city>/<frame>_vehicle.json           speed, yawRate, GPS
    SRC/timestamp_sequence/<split>/<city>/<frame>_timestamp.txt        integer nanoseconds
    SRC/camera/<split>/<city>/<frame>_camera.json                      for each frame, or at least one of a sequence
    SRC/gtFine/<split>/<city>/<frame>_gtFine_labelIds.png              where present

<frame> is `<city>_<sequence>_<number>`. In some cities the number runs on over several recordings, each of 30 frames,
so numbers that do not follow each other mean either that another recording begins or that a frame is lost. Counted
from the first frame of a recording in stretches of 30, a break inside a stretch is a loss; a break at the end of a
stretch, or one that leads beyond its end, begins another recording. Recordings that join without a break stay one.

Every fault fails its recording as a whole and names the file: a lost frame, a missing disparity, vehicle or time stamp
file, several label images of a frame, no camera file at all, camera files that differ, time stamps that do not grow,
a picture of another size or bit depth, a damaged picture, broken JSON, a missing or impossible value. No frame is
dropped, because windows count frames: a hole would move every later target in time. Frames without a label image are
no fault. Files whose names begin with a dot, such as those that macOS leaves beside others, are ignored.
"""

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.faults import not_one_of
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs, how_to_label
from semgrid_eval.sources.cityscapes.sequence import CityscapesSequence, SequenceFrame, frame_name, sibling
from semgrid_eval.sources.cityscapes.source import CityscapesOptions

RECORDING_FRAMES = 30
_IMAGES = "leftImg8bit_sequence"
_CAMERA_NAME = re.compile(r"[A-Za-z0-9_-]+")
_IMAGE_NAME = re.compile(r"(?P<sequence>.+_[0-9]+)_(?P<number>[0-9]+)_leftImg8bit\.png")


def find_sequences(options: CityscapesOptions) -> list[CityscapesSequence]:
    """List the chosen recordings of a tree, sorted by split and name, without reading any file.

    Raises:
        InputError: there is no such folder or split, no sequence in it, a label image's name says the other kind of
            ids, or the camera cannot be called so.
    """
    if not _CAMERA_NAME.fullmatch(options.camera_name):
        raise InputError(f"{options.camera_name!r} is not a name of letters, digits, _ and -", field="camera_name")
    root, labels = options.src / _IMAGES, options.labels
    if not root.is_dir():
        raise InputError("is not a folder; a Cityscapes sequence tree has one", path=root)
    if labels is not None and not labels.is_dir():
        raise InputError("is not a folder of label images", path=labels)
    pattern = "*/[!.]*_leftImg8bit.png"
    images = [image for split in _splits(root, options.split) for image in sorted((root / split).glob(pattern))]
    runs = list(_runs(images))
    label_files = _LabelFiles(labels, images, train_ids=options.train_ids)
    sequences = [_sequence(run, label_files, options) for run in runs]
    if not sequences:
        raise InputError("holds no <split>/<city>/<city>_<sequence>_<number>_leftImg8bit.png", path=root)
    return sorted(sequences, key=lambda sequence: (sequence.split, sequence.name))


def _splits(root: Path, wanted: Collection[str]) -> list[str]:
    there = sorted(path.name for path in root.iterdir() if path.is_dir())
    for split in wanted:
        if split not in there:
            raise InputError(f"split {not_one_of(split, there)}", path=root)
    return sorted(set(wanted)) or there


def _runs(images: Iterable[Path]) -> Iterator[list[tuple[int, Path]]]:
    """Group images by folder and sequence, and cut where another recording begins: lists of (number, image)."""
    groups: dict[tuple[Path, str], list[tuple[int, Path]]] = defaultdict(list)
    for image in images:
        match = _IMAGE_NAME.fullmatch(image.name)
        if match is not None:
            groups[image.parent, match["sequence"]].append((int(match["number"]), image))
    for group in groups.values():
        group.sort()
        starts = [0, *recording_starts([number for number, _ in group]), len(group)]
        for start, end in pairwise(starts):
            yield group[start:end]


def recording_starts(numbers: Sequence[int]) -> list[int]:
    """Return the indices, without 0, where another recording begins in ascending frame numbers."""
    starts = []
    first = numbers[0]
    for index in range(1, len(numbers)):
        before, now = numbers[index - 1], numbers[index]
        stretches = -(-(before - first + 1) // RECORDING_FRAMES)
        if now > before + 1 and now >= first + stretches * RECORDING_FRAMES:
            starts.append(index)
            first = now
    return starts


def _sequence(
    run: list[tuple[int, Path]], label_files: "_LabelFiles", options: CityscapesOptions
) -> CityscapesSequence:
    first = run[0][1]
    return CityscapesSequence(
        name=frame_name(first),
        split=first.parent.parent.name,
        city=first.parent.name,
        camera_name=options.camera_name,
        frames=tuple(_frame(image, label_files) for _, image in run),
        lost=_lost_image(run),
        train_ids=options.train_ids,
    )


def _frame(image: Path, label_files: "_LabelFiles") -> SequenceFrame:
    camera = sibling(image, "camera", "_camera.json")
    return SequenceFrame(
        image=image,
        disparity=sibling(image, "disparity_sequence", "_disparity.png"),
        vehicle=sibling(image, "vehicle_sequence", "_vehicle.json"),
        timestamp=sibling(image, "timestamp_sequence", "_timestamp.txt"),
        camera=camera if camera.is_file() else None,
        labels=label_files.of(image),
    )


def _lost_image(run: list[tuple[int, Path]]) -> Path | None:
    for (number, image), (following, _) in pairwise(run):
        if following != number + 1:
            sequence, digits, _ = image.name.rsplit("_", 2)
            return image.with_name(f"{sequence}_{number + 1:0{len(digits)}d}_leftImg8bit.png")
    return None


class _LabelFiles:
    """Finds the label images of a frame: gtFine's, or those in a folder whose names begin with the frame's.

    Where a folder has several for a frame, those named `*labelIds.png` (`*labelTrainIds.png` for train ids) are meant.
    Without such a one, any that is named as the other kind is an error: each kind can pass for the other unnoticed.
    """

    def __init__(self, folder: Path | None, images: Sequence[Path], *, train_ids: bool) -> None:
        self._folder = folder
        self._kind, self._other = ("labelTrainIds", "labelids") if train_ids else ("labelIds", "trainids")
        self._advice = "label ids; leave out --train-ids" if train_ids else "train ids; add --train-ids"
        self._found: dict[str, list[Path]] = defaultdict(list)
        if folder is not None:
            frames = {frame_name(image) for image in images}
            for path in sorted(folder.rglob("*.png")):
                ends = (match.start() for match in re.finditer(r"[_.-]", path.name))
                named = [path.name[:end] for end in ends if path.name[:end] in frames]
                if named:
                    self._found[named[-1]].append(path)
            if not self._found:
                wanted = f"{frame_name(images[0])}_" if images else "a frame's"
                raise InputError(f"holds no .png whose name begins with {wanted}", path=folder, field="labels")

    def of(self, image: Path) -> tuple[Path, ...]:
        if self._folder is None:
            label = sibling(image, "gtFine", f"_gtFine_{self._kind}.png")
            return (label,) if label.is_file() else ()
        found = tuple(self._found.get(frame_name(image), ()))
        exact = tuple(path for path in found if path.stem.lower().endswith(self._kind.lower()))
        for path in found if not exact else ():
            if path.stem.lower().endswith(self._other):
                raise InputError(f"is named as {self._advice}", path=path)
        return exact or found


def convert_cityscapes(options: CityscapesOptions, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of a sequence tree; those that are up to date stay as they are.

    Raises:
        InputError: the tree or an option cannot be used, or the disk is full.
    """
    sequences = find_sequences(options)
    summary = convert_jobs([ConversionJob(s.name, s.split, s.digest, s.recording) for s in sequences], out, work)
    kept = (each for each in sequences if f"{each.split}/{each.name}" not in summary.failed)
    frames = [frame for each in kept for frame in each.frames]
    if unlabelled := sum(not frame.labels for frame in frames):
        summary.remark = f"{unlabelled} of {len(frames)} frames have no labels: {how_to_label(out)}"
    return summary
