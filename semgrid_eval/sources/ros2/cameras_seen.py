"""Which topics of a bag look like the pictures of which camera, by their types, sizes, frames and names."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.contents import Contents
from semgrid_eval.sources.ros2.pictures import require_coding

_LABEL_WORDS = ("label", "segment", "semantic", "/seg", "_seg")
_DEPTH_WORDS = ("depth",)
_DEPTH_CODINGS = ("16UC1", "32FC1")
_GENERIC = re.compile(
    "camera|image|info|raw|rect|rectified|color|colour|rgb|bgr|mono|gray|compressed|depth|disparity|registered|aligned|"
    "labels?|segmentation|semantic|sensing|sensors?|to",
    re.IGNORECASE,
)
_TRANSPORT = re.compile("/compressed(Depth)?$")


@dataclass(frozen=True)
class CameraSeen:
    """Topics of one camera; empty where the bag does not have it."""

    info: str
    image: str = ""
    disparity: str = ""
    depth: str = ""
    right: str = ""
    right_info: str = ""
    labels: str = ""

    @property
    def main(self) -> str:
        """The topic that is the camera's own."""
        return self.image or self.depth or self.disparity

    @property
    def lacks(self) -> str:
        """What the bag does not give of it, in words; empty if a log can hold it."""
        if not self.info:
            return "no CameraInfo of its own is in the bag"
        return "" if self.image or self.labels else "it has neither images nor labels"


def words_of(topic: str) -> list[str]:
    """Return the words of a topic that are not said of every camera."""
    return [word for word in re.findall(r"[A-Za-z0-9-]+", topic) if not _GENERIC.fullmatch(word)]


def cameras_of(contents: Contents) -> tuple[list[CameraSeen], list[str]]:
    """Return the cameras in the order of their topics, and pictures that belong to none of them for sure."""
    return _Finder(contents).found()


class _Finder:
    """Pairs the pictures of a bag."""

    def __init__(self, contents: Contents) -> None:
        self._topics = contents.topics
        self._infos = {name: seen.info for name, seen in self._topics.items() if seen.info is not None}
        labels = [name for name in self._readable("labels") if _has_word(name, _LABEL_WORDS)]
        depths = [name for name in self._readable("depth") if self._is_depth(name)]
        disparities = [name for name, seen in self._topics.items() if seen.kind == kinds.DISPARITY and seen.shape]
        colours = [name for name in self._readable("image") if name not in (*labels, *depths)]
        self._colours = [name for name in colours if not _has_word(name, _LABEL_WORDS)] or colours
        self._beside = {
            "disparity": sorted(disparities, key=_preference),
            "depth": sorted(depths, key=_preference),
            "labels": sorted(labels, key=_preference),
        }

    def found(self) -> tuple[list[CameraSeen], list[str]]:
        cameras, left_over = self._with_images(), list[str]()
        for what in ("disparity", "depth"):
            cameras, rest = self._joined(cameras, what)
            left_over += rest
        without_image = [name for name in left_over if self.info_of(name)]
        cameras += self._without_images(without_image)
        cameras, unknown = self._joined(cameras, "labels")
        unknown += [name for name in left_over if name not in without_image]
        cameras = [replace(each, info="") if self._borrows(each, cameras) else each for each in cameras]
        return sorted(cameras, key=lambda camera: camera.main), sorted(unknown)

    def info_of(self, topic: str) -> str:
        """Return the CameraInfo beside a topic, else the one of its size that its frame or name tells."""
        same_size = [info for info in self._infos if self._calibrates(info, topic)]
        depths = {info: len(_namespace(info)) for info in same_size if topic.startswith(f"{_namespace(info)}/")}
        beside = [info for info, depth in depths.items() if depth == max(depths.values())]
        others = [info for info in same_size if not self._is_of_right(info)]
        return self._closest(topic, beside or others, alone=True)

    def _with_images(self) -> list[CameraSeen]:
        infos = {name: self.info_of(name) for name in self._colours}
        groups: dict[tuple[str, str], list[str]] = {}
        for name in self._colours:
            key = (infos[name] or name, self._topics[name].frame)
            groups.setdefault(key, []).append(name)
        chosen = [min(names, key=_preference) for names in groups.values()]
        rights = [name for name in self._colours if infos[name] and self._is_of_right(infos[name])]
        lefts = {name: self._right_of(name, chosen, rights) for name in chosen if name not in rights}
        taken = {infos[right] for right in lefts.values() if right}
        alone = {name: "" for name in chosen if name in rights and infos[name] not in taken}
        return [
            CameraSeen(infos[name], image=name, right=right, right_info=infos[right] if right else "")
            for name, right in {**lefts, **alone}.items()
        ]

    def _without_images(self, topics: Sequence[str]) -> list[CameraSeen]:
        cameras: dict[str, CameraSeen] = {}
        for name in topics:
            what = "disparity" if name in self._beside["disparity"] else "depth"
            info = self.info_of(name)
            camera = cameras.setdefault(info, CameraSeen(info))
            cameras[info] = camera if getattr(camera, what) else replace(camera, **{what: name})
        return list(cameras.values())

    def _right_of(self, image: str, images: Sequence[str], rights: Sequence[str]) -> str:
        """Return the right image of a pair, of the size and coding of the left one."""
        shape = self._topics[image].shape
        lefts = [name for name in images if name not in rights and self._topics[name].shape == shape]
        alike = (name for name in sorted(rights, key=_preference) if self._topics[name].shape == shape)
        return next((name for name in alike if self._closest(name, lefts, alone=True) == image), "")

    def _joined(self, cameras: Sequence[CameraSeen], what: str) -> tuple[list[CameraSeen], list[str]]:
        """Give cameras their pictures of one use, and return those that no camera got, as well."""
        found, left_over = list(cameras), list[str]()
        mains = {camera.main: index for index, camera in enumerate(found)}
        for name in self._beside[what]:
            fitting = [main for main in mains if self._same_size(main, name)]
            main = self._closest(name, fitting, alone=len(mains) == 1)
            if not main:
                left_over.append(name)
            elif self._is_better(name, getattr(found[mains[main]], what), main):
                found[mains[main]] = replace(found[mains[main]], **{what: name})
        return found, left_over

    def _is_better(self, name: str, given: str, main: str) -> bool:
        """Tell whether a picture is nearer to a camera than the one it has; the first of equal ones counts."""
        frame = self._topics[main].frame
        return not given or (self._topics[name].frame == frame != self._topics[given].frame)

    def _closest(self, topic: str, others: Sequence[str], *, alone: bool) -> str:
        """Return the topic that belongs to one: that of its frame, or that with most words in common.

        With `alone`, an only one does; of several that are equally close, none.
        """
        if alone and len(others) == 1:
            return others[0]
        framed = [other for other in others if self._topics[other].frame == self._topics[topic].frame != ""]
        if len(framed) == 1:
            return framed[0]
        shared = {other: len(set(words_of(other)) & set(words_of(topic))) for other in framed or others}
        best = [other for other, count in shared.items() if count == max(shared.values()) > 0]
        return best[0] if len(best) == 1 else ""

    def _readable(self, use: str) -> list[str]:
        topics = self._topics.items()
        return [
            name
            for name, seen in topics
            if seen.kind in kinds.PICTURES and seen.shape and _can_be(use, seen.shape.coding)
        ]

    def _is_depth(self, name: str) -> bool:
        shape = self._topics[name].shape
        return (shape is not None and shape.coding in _DEPTH_CODINGS) or _has_word(name, _DEPTH_WORDS)

    def _borrows(self, camera: CameraSeen, cameras: Sequence[CameraSeen]) -> bool:
        """Tell whether a camera has got a CameraInfo of its size that is another one's: of another place and frame."""
        shared = any(each.info == camera.info for each in cameras if each is not camera)
        is_beside = _namespace(_TRANSPORT.sub("", camera.main)) == _namespace(camera.info)
        is_framed = camera.info != "" and self._topics[camera.info].frame == self._topics[camera.main].frame
        return shared and not (is_beside or is_framed)

    def _is_of_right(self, info: str) -> bool:
        """Tell whether a CameraInfo is that of the second camera of a pair: P[3] = -f B."""
        return self._infos[info].p[3] < 0

    def _calibrates(self, info: str, topic: str) -> bool:
        shape, told = self._topics[topic].shape, self._infos[info]
        return shape is not None and (shape.width, shape.height) == (told.width, told.height)

    def _same_size(self, topic: str, other: str) -> bool:
        one, another = self._topics[topic].shape, self._topics[other].shape
        return one is not None and another is not None and (one.width, one.height) == (another.width, another.height)


def _can_be(use: str, coding: str) -> bool:
    try:
        require_coding(use, coding)
    except InputError:
        return False
    return True


def _namespace(topic: str) -> str:
    return topic.rpartition("/")[0]


def _has_word(name: str, words: Iterable[str]) -> bool:
    return any(word in name.lower() for word in words)


def _preference(name: str) -> tuple[bool, bool, bool, str]:
    """Rectified before raw, colour before gray, raw pixels before compressed ones."""
    return "rect" not in name, "mono" in name, name.lower().endswith("compressed"), name
