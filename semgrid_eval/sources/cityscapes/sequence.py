"""One recording of a Cityscapes tree: its files, their digest, and the moments they hold."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.png import PngHeader
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, Moment, Recording
from semgrid_eval.sources.cityscapes import files

_CONVERSION_VERSION = 1  # to be raised when the same files give another recording


@dataclass(frozen=True)
class SequenceFrame:
    """The files of one frame; required ones may be missing, which reading them reports."""

    image: Path
    disparity: Path
    vehicle: Path
    timestamp: Path
    camera: Path | None
    labels: tuple[Path, ...]  # more than one is a fault

    def required(self) -> tuple[Path, ...]:
        """List what every frame must have."""
        return self.image, self.disparity, self.vehicle, self.timestamp

    def present(self) -> tuple[Path, ...]:
        """List all files."""
        return (*self.required(), *(() if self.camera is None else (self.camera,)), *self.labels)


@dataclass(frozen=True)
class CityscapesSequence:
    """One recording of a Cityscapes tree, found but not read yet; its faults are InputErrors that name a file."""

    name: str  # that of its first frame
    split: str  # the folder that it is in
    city: str  # the folder in that of the split
    camera_name: str  # what its camera shall be called in the log
    frames: tuple[SequenceFrame, ...]  # in the order of their numbers
    lost: Path | None  # where the image of the first lost frame should be; None where the numbers have no gap
    train_ids: bool  # whether label images hold train ids instead of label ids

    def digest(self) -> str:
        """Digest the bytes of all files and the options; computed once."""
        return self._digest

    def recording(self) -> Recording:
        """Return the recording; it reads its pictures only while it is streamed."""
        digest = self.digest()
        stamps_ns = self._stamps_ns()
        return Recording(
            name=self.name,
            dataset="cityscapes",
            split=self.split,
            group=self.city,
            calibrations={self.camera_name: self._calibration()},
            source_digest=digest,
            moments=lambda: self._moments(stamps_ns),
            source_files={f"{self.camera_name}_camera.json": files.read_file(self._camera_files[0])},
        )

    @cached_property
    def _digest(self) -> str:
        self._require_files()
        options = [_CONVERSION_VERSION, self.name, self.split, self.camera_name, self.train_ids]
        names = [[path.name for path in frame.present()] for frame in self.frames]
        present = (path for frame in self.frames for path in frame.present())
        content = digest_files(present, limit=files.MAX_FILE_BYTES)
        return digest_value([options, names, content])

    @property
    def _camera_files(self) -> list[Path]:
        return [frame.camera for frame in self.frames if frame.camera is not None]

    def _require_files(self) -> None:
        if self.lost is not None:
            raise InputError("is missing: a gap in the numbering", path=self.lost)
        for path in (path for frame in self.frames for path in frame.required()):
            if not path.is_file():
                raise InputError("is missing", path=path)
        for frame in self.frames:
            if len(frame.labels) > 1:
                raise InputError(f"is one of {len(frame.labels)} label images of its frame", path=frame.labels[0])
        if not self._camera_files:
            expected = sibling(self.frames[0].image, "camera", "_camera.json")
            raise InputError("is missing, as for every frame of this sequence; one is needed", path=expected)

    def _calibration(self) -> CameraCalibration:
        first, *others = self._camera_files
        calibration = files.read_camera(first)
        for other in others:
            if files.read_camera(other) != calibration:
                raise InputError(f"differs from {first.name}; a sequence has one calibration", path=other)
        return calibration

    def _stamps_ns(self) -> list[int]:
        stamps_ns = [files.read_stamp(frame.timestamp) for frame in self.frames]
        for frame, (before_ns, now_ns) in zip(self.frames[1:], pairwise(stamps_ns), strict=True):
            if now_ns <= before_ns:
                raise InputError(f"{now_ns} ns is not after the frame before, {before_ns} ns", path=frame.timestamp)
        return stamps_ns

    def _moments(self, stamps_ns: Sequence[int]) -> Iterator[Moment]:
        first: PngHeader | None = None
        for frame, stamp_ns in zip(self.frames, stamps_ns, strict=True):
            image, size = files.read_picture(frame.image, 8, gray=False)
            disparity, disparity_size = files.read_picture(frame.disparity, 16, gray=True)
            first, label = first or size, None
            _require_size(frame.image, size, first)
            _require_size(frame.disparity, disparity_size, first)
            for path in frame.labels:
                label, label_size = files.read_label(path, train_ids=self.train_ids)
                _require_size(path, label_size, first)
            picture = CameraFrame(stamp_ns, image_file=image, disparity_png=disparity, label_png=label)
            yield Moment(stamp_ns, {self.camera_name: picture}, (files.read_vehicle(frame.vehicle, stamp_ns),))


def frame_name(image: Path) -> str:
    """Return `<city>_<sequence>_<number>`."""
    return image.name.removesuffix("_leftImg8bit.png")


def sibling(image: Path, channel: str, suffix: str) -> Path:
    """Return the path of another channel's file that belongs to an image."""
    split, city = image.parent.parent, image.parent
    return split.parent.parent / channel / split.name / city.name / f"{frame_name(image)}{suffix}"


def _require_size(path: Path, header: PngHeader, first: PngHeader) -> None:
    if header[:2] != first[:2]:
        found, began = (ImageSize(*each[:2]) for each in (header, first))
        raise InputError(f"is {found}, but the sequence began with {began}", path=path)
