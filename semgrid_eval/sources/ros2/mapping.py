"""The map file: which topics of a bag are which camera or LiDAR, where they sit, and what tells the motion."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.labels import LABEL_ID

Topic = Annotated[str, Field(pattern=r"^/\S+$")]
Positive = Annotated[float, Field(gt=0)]
SensorName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
_DEPTHS = ("disparity", "depth", "right")
"""What tells the depth of a camera's pixels."""
HIGHEST_PIXEL, HIGHEST_POINT = 255, 65_535
"""Ids that the label of a pixel, and that of a point, can have."""
Ids = dict[str, tuple[int, ...]]
"""Ids by name of the Cityscapes label that they stand for."""


class VehicleMap(Config):
    """The vehicle frame: x ahead, y left, z up."""

    frame: str = "base_link"
    height_m: float = 0.0  # of its origin above the ground
    rear_axle_m: float = 0.0  # how far its origin lies ahead of the rear axle
    tf: tuple[Topic, ...] = ("/tf_static", "/tf")  # tf2_msgs/TFMessage; what is given first counts


class SpeedMap(Config):
    """What tells the speed ahead."""

    topic: Topic
    by: Literal["twist", "pose"] = "twist"  # of an Odometry: its twist, or its poses, differentiated


class YawRateMap(Config):
    """What tells the yaw rate, where that is another topic."""

    topic: Topic
    by: Literal["twist", "pose"] = "twist"
    aligned: bool = False  # an Imu's axes count as the vehicle's; otherwise tf tells how it is turned


class MotionMap(Config):
    """What tells the motion of the vehicle."""

    speed: SpeedMap
    yaw_rate: YawRateMap | None = None  # None: the same topic as the speed

    @property
    def turning(self) -> YawRateMap:
        """What tells the yaw rate."""
        return self.yaw_rate or YawRateMap(topic=self.speed.topic, by=self.speed.by, aligned=True)


class Extrinsics(Config):
    """Where a sensor sits in the vehicle frame, its own axes ahead, left and up; positive pitch looks down."""

    x_m: float
    y_m: float
    z_m: float
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0


class CameraMap(Config):
    """The topics of one camera; without `disparity`, `depth` and `right` it is a single one."""

    image: Topic | None = None
    info: Topic
    rectified: bool  # whether image, labels, depth and right image are rectified; a DisparityImage always is
    disparity: Topic | None = None  # stereo_msgs/DisparityImage
    depth: Topic | None = None  # 16UC1 in mm or 32FC1 in m
    right: Topic | None = None  # the right image of a stereo pair, to be matched with the left one
    right_info: Topic | None = None
    baseline_m: Positive | None = None  # where no topic tells it; for depth any, it sets how finely depth is coded
    labels: Topic | None = None
    ids: Literal["label_ids", "train_ids"] | Ids = "label_ids"
    frame: str | None = None  # the camera's frame in tf, where messages name another
    extrinsics: Extrinsics | None = None  # None: tf tells them

    @model_validator(mode="after")
    def _has_at_most_one_depth(self) -> Self:
        given = [name for name in _DEPTHS if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"one of {', '.join(_DEPTHS)} at most, not {' and '.join(given)}")
        if not given:
            self._check_single()
        if self.right is not None and (self.image is None or self.right_info is None):
            raise ValueError("right needs image and right_info")
        if self.depth is not None and self.baseline_m is None and self.right_info is None:
            raise ValueError("depth needs baseline_m, by which it is coded as disparity; 0.5 is a good one")
        return self

    def _check_single(self) -> None:
        if self.image is None and self.labels is None:
            raise ValueError("names neither image nor labels, nor what tells its depth")
        for name in ("baseline_m", "right_info"):
            if getattr(self, name) is not None:
                raise ValueError(f"{name} needs one of {', '.join(_DEPTHS)}")

    @model_validator(mode="after")
    def _names_known_labels(self) -> Self:
        _require_labels(self.ids, HIGHEST_PIXEL)
        return self

    @property
    def is_single(self) -> bool:
        """Whether nothing tells its depth."""
        return all(getattr(self, name) is None for name in _DEPTHS)

    @property
    def main_topic(self) -> str:
        """The topic whose stamps are those of the frames."""
        found = self.disparity or self.depth or self.image or self.labels
        assert found is not None
        return found

    def pictures(self) -> dict[str, str]:
        """Return the topics of all pictures by what they are."""
        given = {name: getattr(self, name) for name in ("image", "disparity", "depth", "right", "labels")}
        return {name: topic for name, topic in given.items() if topic is not None}


class PointTimes(Config):
    """Which field of a cloud tells when each point was measured."""

    field: str
    unit: Literal["s", "ms", "us", "ns"]
    since: Literal["stamp", "epoch"] = "stamp"  # what it counts from: the stamp of its cloud, or 1970


class LidarMap(Config):
    """The topic of one LiDAR."""

    cloud: Topic  # sensor_msgs/PointCloud2
    times: PointTimes | None = None  # None: all points of a cloud are of one time
    label_field: str | None = None  # None: points have no labels
    ids: Literal["label_ids", "train_ids", "semantickitti"] | Ids = "label_ids"
    frame: str | None = None  # the LiDAR's frame in tf, where messages name another
    extrinsics: Extrinsics | None = None  # None: tf tells them

    @model_validator(mode="after")
    def _names_known_labels(self) -> Self:
        _require_labels(self.ids, HIGHEST_POINT)
        return self


class BagMap(Config):
    """What a bag's topics are."""

    vehicle: VehicleMap = VehicleMap()
    clock: Literal["header", "received"] = "header"  # whose stamps count: the messages', or the recorder's
    tolerance_s: float = Field(default=0.01, ge=0, le=1)  # pictures of one frame differ by no more
    motion: MotionMap
    cameras: dict[SensorName, CameraMap] = Field(default_factory=dict)
    lidars: dict[SensorName, LidarMap] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _names_sensors(self) -> Self:
        if not self.cameras and not self.lidars:
            raise ValueError("cameras or lidars: one is needed")
        if same := self.cameras.keys() & self.lidars.keys():
            raise ValueError(f"lidars: {min(same)!r} is the name of a camera already")
        return self

    @property
    def single(self) -> set[str]:
        """Names of the cameras whose depth nothing tells."""
        return {name for name, camera in self.cameras.items() if camera.is_single}


def load_map(path: Path) -> BagMap:
    """Read a map file.

    Raises:
        InputError: there is none; a ConfigError if it is malformed.
    """
    if not path.exists():
        message = "is missing; make a first one with: semgrid-eval convert ros2 BAG --inspect"
        raise InputError(message, path=path, field="map")
    return parse_config(BagMap, load_yaml(path), path=path)


def _require_labels(ids: str | Ids, highest: int) -> None:
    """Make sure that ids are given to labels of Cityscapes, each to one, and are not beyond what a label can hold."""
    owners: dict[int, str] = {}
    for name, given in ids.items() if isinstance(ids, dict) else ():
        if name not in LABEL_ID:
            raise ValueError(f"ids: {name!r} is not one of {', '.join(LABEL_ID)}")
        for each in given:
            if not 0 <= each <= highest:
                raise ValueError(f"ids: {each} is not within 0 to {highest}")
            if owners.setdefault(each, name) != name:
                raise ValueError(f"ids: {each} is given to {owners[each]} and to {name}")
