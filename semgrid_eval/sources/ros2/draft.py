"""A first map file, guessed from types and names, with comments on what was guessed."""

from collections.abc import Iterator

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.contents import Contents, Seen
from semgrid_eval.sources.ros2.draft_lidars import draft_lidars, place_lines
from semgrid_eval.sources.ros2.labels import likely_ids
from semgrid_eval.sources.ros2.pictures import require_coding

_LABEL_WORDS = ("label", "segment", "semantic", "/seg", "_seg")
_RIGHT_WORDS = ("right", "infra2", "cam1")
_DEPTH_WORDS = ("depth",)
_VEHICLE_FRAMES = ("base_link", "base_footprint", "ego_vehicle", "vehicle")
_VIRTUAL_BASELINE_M = 0.5


def draft_map(contents: Contents) -> str:
    """Return a map file as text; what could not be guessed is left open there, and says so."""
    vehicle = _vehicle_frame(contents)
    lines = [
        "# Which topics of a bag are what; docs/own-car.md says what else can stand here.",
        "vehicle:",
        f"  frame: {vehicle}  # x ahead, y left, z up",
        "  height_m: 0.0  # of its origin above the ground",
        "  rear_axle_m: 0.0  # how far its origin lies ahead of the rear axle",
        *(["clock: received  # header stamps are all zero"] if contents.unstamped else []),
        *_motion(contents, vehicle),
        *_camera(contents, vehicle),
        *draft_lidars(contents, vehicle),
    ]
    return "\n".join(lines) + "\n"


def _vehicle_frame(contents: Contents) -> str:
    children = [seen.child for seen in contents.topics.values() if seen.kind == kinds.ODOMETRY and seen.child]
    known = [name for name in _VEHICLE_FRAMES if name in contents.transforms.frames]
    return next(iter([*known, *children]), _VEHICLE_FRAMES[0])


def _motion(contents: Contents, vehicle: str) -> Iterator[str]:
    odometry, twists, imus = (_of_kind(contents, kind) for kind in (kinds.ODOMETRY, kinds.TWIST, kinds.IMU))
    yield "motion:"
    if odometry or twists:
        yield f"  speed: {{topic: {[*odometry, *twists][0]}, by: twist}}" + ("  # or by: pose" if odometry else "")
    else:
        yield "  speed: {topic: }  # nothing in the bag tells it: nav_msgs/Odometry or geometry_msgs/TwistStamped"
    if imus and not odometry:
        frame = contents.topics[imus[0]].frame
        is_linked = frame == vehicle or contents.transforms.has(vehicle, frame)
        note = "" if is_linked else "  # nothing links its frame to the vehicle: are its axes those of the vehicle?"
        yield f"  yaw_rate: {{topic: {imus[0]}, aligned: {'false' if is_linked else 'true'}}}{note}"


def _camera(contents: Contents, vehicle: str) -> Iterator[str]:
    found = _Pictures(contents)
    if not found.any and any(seen.cloud for seen in contents.topics.values()):
        return  # a LiDAR alone
    yield "cameras:"
    yield "  front:"
    if found.image:
        yield f"    image: {found.image}"
    info = found.info_of(found.image or found.depth or found.disparity or "")
    yield f"    info: {info or ' # no CameraInfo in the bag'}"
    rectified = _is_rectified(found.image or found.depth or "", contents, info)
    yield f"    rectified: {'true' if rectified else 'false'}"
    yield from found.depth_lines()
    yield from found.label_lines()
    frame = contents.topics[found.image or found.depth or found.disparity].frame if found.any else ""
    yield from place_lines(contents, vehicle, frame or "the camera", "the camera")


class _Pictures:
    """Which topics look like the pictures of a camera."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self.disparity = next(iter(_of_kind(contents, kinds.DISPARITY)), "")
        labels = [name for name in self._readable("labels") if _has_word(name, _LABEL_WORDS)]
        depths = [name for name in self._readable("depth") if self._is_depth(name)]
        colours = [name for name in self._readable("image") if name not in (*labels, *depths)]
        self.labels, self.depth = next(iter(labels), ""), next(iter(depths), "")
        lefts = sorted((name for name in colours if not _has_word(name, _RIGHT_WORDS)), key=_preference)
        self.image = next(iter(lefts), "")
        rights = [name for name in colours if _has_word(name, _RIGHT_WORDS) and self._is_pair(name)]
        self.right = next(iter(sorted(rights, key=_preference)), "")

    @property
    def any(self) -> bool:
        """Whether there is a picture at all."""
        return bool(self.image or self.depth or self.disparity)

    def info_of(self, topic: str) -> str:
        """Return the CameraInfo beside a topic, else one of its size."""
        infos = _of_kind(self._contents, kinds.CAMERA_INFO)
        beside = [name for name in infos if topic.startswith(f"{name.rpartition('/')[0]}/")]
        same = [name for name in infos if self._has_size(name, topic) and not _has_word(name, _RIGHT_WORDS)]
        return next(iter([*sorted(beside, key=len, reverse=True), *same]), "")

    def depth_lines(self) -> Iterator[str]:
        """Say what tells the depth, and by which baseline."""
        right_info = self.info_of(self.right) if self.right else ""
        if self.disparity:
            yield f"    disparity: {self.disparity}"
        elif self.depth:
            yield f"    depth: {self.depth}"
            yield f"    baseline_m: {_VIRTUAL_BASELINE_M}  # sets how finely depth is coded"
        elif self.right:
            yield f"    right: {self.right}  # to be matched with the image"
        else:
            yield "    disparity:  # nothing in the bag tells it: or depth, or right and right_info"
        if right_info and not self.depth:
            yield f"    right_info: {right_info}"

    def label_lines(self) -> Iterator[str]:
        """Say where labels are, if there are some."""
        if not self.labels:
            yield "    # no labels: `semgrid-eval segment` adds them to the logs"
            return
        highest = self._contents.topics[self.labels].highest_id
        ids = "label_ids" if highest is None else likely_ids(highest)
        yield f"    labels: {self.labels}"
        yield f"    ids: {ids}  # the first image holds ids up to {highest}; or names: {{road: [0], car: [13, 14]}}"

    def _readable(self, use: str) -> list[str]:
        found = []
        for name, seen in self._contents.topics.items():
            if seen.kind in kinds.PICTURES and seen.shape is not None and _can_be(use, seen):
                found.append(name)
        return found

    def _is_depth(self, name: str) -> bool:
        seen = self._contents.topics[name]
        assert seen.shape is not None
        return seen.shape.coding in ("16UC1", "32FC1") or _has_word(name, _DEPTH_WORDS)

    def _is_pair(self, name: str) -> bool:
        left, right = self._contents.topics.get(self.image), self._contents.topics[name]
        return left is not None and left.shape == right.shape

    def _has_size(self, info: str, topic: str) -> bool:
        told, seen = self._contents.topics[info].info, self._contents.topics.get(topic)
        if told is None or seen is None or seen.shape is None:
            return False
        return (told.width, told.height) == (seen.shape.width, seen.shape.height)


def _can_be(use: str, seen: Seen) -> bool:
    assert seen.shape is not None
    try:
        require_coding(use, seen.shape.coding)
    except InputError:
        return False
    return True


def _of_kind(contents: Contents, kind: str) -> list[str]:
    return [name for name, seen in contents.topics.items() if seen.kind == kind and seen.count]


def _has_word(name: str, words: tuple[str, ...]) -> bool:
    return any(word in name.lower() for word in words)


def _preference(name: str) -> tuple[bool, bool, bool, str]:
    """Rectified before raw, colour before gray, raw pixels before compressed ones."""
    return "rect" not in name, "mono" in name, name.endswith("compressed"), name


def _is_rectified(topic: str, contents: Contents, info: str) -> bool:
    """Tell by its name, or by a calibration without distortion, whether an image is rectified."""
    told = contents.topics[info].info if info else None
    return "rect" in topic.lower() or topic == "" or (told is not None and not any(told.d))
