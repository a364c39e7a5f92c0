"""A part of a KITTI sequence: its files, their digest, and the moments they hold."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE3
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.recording.types import CameraCalibration, Moment, Pose, Recording
from semgrid_eval.sources.kitti import files
from semgrid_eval.sources.kitti.stereo import LeftCamera, left_camera
from semgrid_eval.sources.poses import motion_of, planar
from semgrid_eval.words import plural

DATASET = "kitti"
CAMERA, LIDAR = "left", "top"
"""Names in logs: of the left colour camera, and of the scanner on the roof."""
_CONVERSION_VERSION = 1  # to be raised when the same files give another recording
_ENDINGS = {"velodyne": ".bin", "labels": ".label", "image_2": ".png", "image_3": ".png"}


@dataclass(frozen=True)
class KittiSequence:
    """The folder of a sequence, and what there is in it; its faults are InputErrors that name a file."""

    folder: Path
    poses: Path
    numbers: tuple[int, ...]  # of its frames
    channels: tuple[str, ...]  # `velodyne`, `labels`, `image_2`, `image_3`: those that are used
    ego_from_camera0: SE3  # to the vehicle frame, from the optical frame of camera 0

    @cached_property
    def stamps_ns(self) -> list[int]:
        """Times of the frames by number: those of all there are lines for."""
        path = self.folder / "times.txt"
        stamps_ns: list[int] = files.read_times_ns(path).tolist()
        _require_lines(path, len(stamps_ns), self.numbers[-1] + 1, "times")
        return stamps_ns

    @cached_property
    def vehicle_poses(self) -> list[Pose]:
        """The vehicle's poses of frames that have both time and pose, in the axes of its first one."""
        found = files.read_poses(self.poses)
        _require_lines(self.poses, len(found), self.numbers[-1] + 1, "poses")
        back = self.ego_from_camera0.inverse()
        return [
            planar(stamp_ns, self.ego_from_camera0 @ pose @ back)
            for stamp_ns, pose in zip(self.stamps_ns, found, strict=False)
        ]

    @cached_property
    def calibration(self) -> files.Calibration:
        """What its calibration file says."""
        return files.read_calibration(self.folder / "calib.txt")

    @property
    def texts(self) -> tuple[Path, ...]:
        """The files that hold for all frames."""
        return self.folder / "calib.txt", self.folder / "times.txt", self.poses

    def file(self, channel: str, number: int) -> Path:
        """Return where the file of a frame is."""
        return self.folder / channel / f"{number:06d}{_ENDINGS[channel]}"


def camera0_at(place_m: tuple[float, float, float]) -> SE3:
    """Place camera 0 in the vehicle frame: it looks straight ahead."""
    x_m, y_m, z_m = place_m
    return SE3.from_roll_pitch_yaw(0.0, 0.0, 0.0, (x_m, y_m, z_m)) @ CAMERA_FROM_OPTICAL


def _require_lines(path: Path, count: int, needed: int, what: str) -> None:
    if count < needed:
        raise InputError(f"has {count} {what}; {needed} are needed", path=path)


@dataclass(frozen=True)
class Part:
    """Some frames of a sequence, which become a recording; it travels to another process."""

    sequence: KittiSequence
    first: int  # number of its first frame
    end: int  # of the frame after its last one
    split: str

    @property
    def name(self) -> str:
        """Name of the recording: that of the sequence and the number of the first frame."""
        return f"{self.sequence.folder.name}_{self.first:06d}"

    def digest(self) -> str:
        """Digest the bytes of all files and the options."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        sequence = self.sequence
        of_frames = [
            sequence.file(channel, number) for number in range(self.first, self.end) for channel in sequence.channels
        ]
        for path in (*sequence.texts, *of_frames):
            if not path.is_file():
                raise InputError("is missing", path=path)
        content = digest_files([*sequence.texts, *of_frames], limit=files.MAX_FILE_BYTES)
        place_m = sequence.ego_from_camera0.translation_m.tolist()
        options = [_CONVERSION_VERSION, self.name, self.split, place_m, sequence.channels]
        return digest_value([options, content])

    def recording(self) -> Recording:
        """Return the recording, which reads scans and images while it is streamed."""
        sequence = self.sequence
        return Recording(
            name=self.name,
            dataset=DATASET,
            split=self.split,
            group=sequence.folder.name,
            calibrations=self._cameras(),
            source_digest=self._digest,
            moments=self._moments,
            source_files={"calib.txt": files.read_file(sequence.folder / "calib.txt")},
        )

    def _moments(self) -> Iterator[Moment]:
        sequence = self.sequence
        poses = sequence.vehicle_poses
        motion = motion_of(poses)
        left_cameras = {name: LeftCamera(calibration) for name, calibration in self._cameras().items()}
        for number in range(self.first, self.end):
            stamp_ns = sequence.stamps_ns[number]
            left, right = (sequence.file(channel, number) for channel in ("image_2", "image_3"))
            cameras = {name: each.frame(stamp_ns, left, right) for name, each in left_cameras.items()}
            sweeps = {LIDAR: self._sweep(number)} if "velodyne" in sequence.channels else {}
            yield Moment(stamp_ns, cameras, (motion[number],), poses[number], sweeps=sweeps)

    def _cameras(self) -> dict[str, CameraCalibration]:
        sequence = self.sequence
        if "image_2" not in sequence.channels:
            return {}
        with_disparity = "image_3" in sequence.channels
        return {CAMERA: left_camera(sequence.calibration, sequence.ego_from_camera0, with_disparity=with_disparity)}

    def _sweep(self, number: int) -> LidarSweep:
        sequence = self.sequence
        scan, label_file = (sequence.file(channel, number) for channel in ("velodyne", "labels"))
        points = files.read_points(scan)
        labels = files.read_labels(label_file) if "labels" in sequence.channels else None
        if labels is not None and len(labels) != len(points):
            raise InputError(
                f"has {plural(len(labels), 'label')}, but {scan.name} has {plural(len(points), 'point')}",
                path=label_file,
            )
        mount = Mount.of(sequence.ego_from_camera0 @ sequence.calibration.camera_from_lidar)
        with located(path=scan):
            return LidarSweep(sequence.stamps_ns[number], mount, points[:, :3], points[:, 3], labels)
