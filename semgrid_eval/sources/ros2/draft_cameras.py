"""The cameras of a first map file, guessed from the first pictures of a bag."""

from collections.abc import Iterator, Sequence

from semgrid_eval.config import yaml_word
from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, yaw_of
from semgrid_eval.sources.ros2.cameras_seen import CameraSeen, cameras_of, words_of
from semgrid_eval.sources.ros2.contents import Contents
from semgrid_eval.sources.ros2.draft_lidars import lidar_names, place_lines
from semgrid_eval.sources.ros2.labels import likely_ids

_ONLY = "front"
_LONGEST_NAME = 40  # of a sensor in a grid
_VIRTUAL_BASELINE_M = 0.5
_SINGLE = (
    "Nothing in the bag tells its depth (disparity, depth, or a right image whose CameraInfo has the baseline in P):",
    "no grids of its own, but its labels colour a LiDAR's points (colour_from of the sensor), and reports show it.",
)


def draft_cameras(contents: Contents, vehicle: str) -> Iterator[str]:
    """Write a block for each camera that a log can hold, that which looks ahead first.

    Where there is neither such a camera nor a LiDAR, what the first one lacks is left open.
    """
    found, unknown = cameras_of(contents)
    whole = _main_first([camera for camera in found if not camera.lacks], contents, vehicle)
    taken = lidar_names(contents)
    if not whole and not taken:
        whole, found = (found or [CameraSeen("")])[:1], found[1:]
    if whole:
        yield "cameras:"
    for name, camera in zip(_names(whole, taken), whole, strict=True):
        yield from _block(name, camera, contents)
        yield from place_lines(contents, vehicle, _frame(camera, contents) or "the camera", "the camera")
    for camera in found:
        if camera.lacks and camera not in whole:
            yield f"# {camera.main}: {camera.lacks}: left out."
    for topic in unknown:
        yield f"# {topic}: neither its frame nor its name tells of which camera it is: left out."


def _main_first(cameras: Sequence[CameraSeen], contents: Contents, vehicle: str) -> list[CameraSeen]:
    """Put the camera first that by tf looks ahead; the others stay in their order."""

    def away(camera: CameraSeen) -> float:
        frame = _frame(camera, contents)
        if not contents.transforms.has(vehicle, frame):
            return float("inf")
        vehicle_from_camera = contents.transforms.lookup(vehicle, frame) @ CAMERA_FROM_OPTICAL.inverse()
        return round(abs(yaw_of(vehicle_from_camera.rotation)), 3)

    main = min(cameras, key=away, default=None)
    return [] if main is None else [main, *(camera for camera in cameras if camera is not main)]


def _names(cameras: Sequence[CameraSeen], taken: Sequence[str]) -> list[str]:
    """Name cameras by what is particular in their topics, and not as a LiDAR."""
    if len(cameras) == 1 and _ONLY not in taken:
        return [_ONLY]
    words = [words_of(camera.main) for camera in cameras]
    common = set(words[0]).intersection(*words) if words else set()
    particular = ["_".join(word for word in each if word not in common) for each in words]
    for proposed in (particular, ["_".join(each) for each in words]):
        names = [f"{name}_camera" if name in taken else name for name in proposed]
        if len(set(names)) == len(names) and all(0 < len(name) <= _LONGEST_NAME for name in names):
            return names
    return [f"camera{number}" for number in range(1, len(cameras) + 1)]


def _block(name: str, camera: CameraSeen, contents: Contents) -> Iterator[str]:
    yield f"  {yaml_word(name)}:"
    if camera.image:
        yield f"    image: {yaml_word(camera.image)}"
    yield f"    info: {yaml_word(camera.info) if camera.info else ' # no CameraInfo of its size in the bag'}"
    rectified = _is_rectified(camera.image or camera.depth, contents, camera.info)
    yield f"    rectified: {'true' if rectified else 'false'}"
    yield from _depth(camera)
    yield from _labels(camera, contents)


def _depth(camera: CameraSeen) -> Iterator[str]:
    """Say what tells the depth, and by which baseline."""
    if camera.disparity:
        yield f"    disparity: {yaml_word(camera.disparity)}"
    elif camera.depth:
        yield f"    depth: {yaml_word(camera.depth)}"
        yield f"    baseline_m: {_VIRTUAL_BASELINE_M}  # sets how finely depth is coded"
    elif camera.right:
        yield f"    right: {yaml_word(camera.right)}  # to be matched with the image"
    else:
        yield from (f"    # {line}" for line in _SINGLE)
    if camera.right_info and (camera.disparity or not camera.depth):
        yield f"    right_info: {yaml_word(camera.right_info)}"


def _labels(camera: CameraSeen, contents: Contents) -> Iterator[str]:
    """Say where labels are, if there are some."""
    if not camera.labels:
        yield "    # no labels: `semgrid-eval segment` adds them to the logs"
        return
    highest = contents.topics[camera.labels].highest_id
    ids = "label_ids" if highest is None else likely_ids(highest)
    yield f"    labels: {yaml_word(camera.labels)}"
    yield f"    ids: {ids}  # the first image holds ids up to {highest}; or names: {{road: [0], car: [13, 14]}}"


def _frame(camera: CameraSeen, contents: Contents) -> str:
    return contents.topics[camera.main].frame if camera.main else ""


def _is_rectified(topic: str, contents: Contents, info: str) -> bool:
    """Tell by its name, or by a calibration without distortion, whether an image is rectified."""
    told = contents.topics[info].info if info else None
    return "rect" in topic.lower() or topic == "" or (told is not None and not any(told.d))
