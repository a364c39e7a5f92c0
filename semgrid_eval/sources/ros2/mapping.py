"""The map file: which topics of a bag are which camera, where cameras sit, and what tells the motion."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from semgrid_eval.classes import LABEL_ID
from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.errors import InputError

Topic = Annotated[str, Field(pattern=r"^/\S+$")]
Positive = Annotated[float, Field(gt=0)]
MAP_FILE = "map.yaml"


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
    """Where a camera sits in the vehicle frame; positive pitch looks down."""

    x_m: float
    y_m: float
    z_m: float
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0


class CameraMap(Config):
    """The topics of one camera; one of `disparity`, `depth` and `right` is needed."""

    image: Topic | None = None
    info: Topic
    rectified: bool  # whether image, labels, depth and right image are rectified; a DisparityImage always is
    disparity: Topic | None = None  # stereo_msgs/DisparityImage
    depth: Topic | None = None  # 16UC1 in mm or 32FC1 in m
    right: Topic | None = None  # the right image of a stereo pair, to be matched with the left one
    right_info: Topic | None = None
    baseline_m: Positive | None = None  # where no topic tells it; for depth any, it sets how finely depth is coded
    labels: Topic | None = None
    ids: Literal["label_ids", "train_ids"] | dict[str, tuple[int, ...]] = "label_ids"
    frame: str | None = None  # the camera's frame in tf, where messages name another
    extrinsics: Extrinsics | None = None  # None: tf tells them

    @model_validator(mode="after")
    def _has_one_depth(self) -> Self:
        given = [name for name in ("disparity", "depth", "right") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"one of disparity, depth and right is needed, not {' and '.join(given) or 'none'}")
        if self.right is not None and (self.image is None or self.right_info is None):
            raise ValueError("right needs image and right_info")
        if self.depth is not None and self.baseline_m is None and self.right_info is None:
            raise ValueError("depth needs baseline_m, by which it is coded as disparity; 0.5 is a good one")
        return self

    @model_validator(mode="after")
    def _names_known_labels(self) -> Self:
        for name, ids in self.ids.items() if isinstance(self.ids, dict) else ():
            if name not in LABEL_ID:
                raise ValueError(f"ids: {name!r} is not one of {', '.join(LABEL_ID)}")
            if wrong := [each for each in ids if not 0 <= each <= 255]:
                raise ValueError(f"ids: {wrong[0]} is not within 0 to 255")
        return self

    @property
    def depth_topic(self) -> str:
        """The topic whose stamps are those of the frames."""
        found = self.disparity or self.depth or self.image
        assert found is not None
        return found

    def pictures(self) -> dict[str, str]:
        """Return the topics of all pictures by what they are."""
        given = {name: getattr(self, name) for name in ("image", "disparity", "depth", "right", "labels")}
        return {name: topic for name, topic in given.items() if topic is not None}


class BagMap(Config):
    """What a bag's topics are."""

    vehicle: VehicleMap = VehicleMap()
    clock: Literal["header", "received"] = "header"  # whose stamps count: the messages', or the recorder's
    tolerance_s: float = Field(default=0.01, ge=0, le=1)  # pictures of one frame differ by no more
    motion: MotionMap
    cameras: dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")], CameraMap] = Field(min_length=1)


def load_map(path: Path) -> BagMap:
    """Read a map file.

    Raises:
        InputError: there is none; a ConfigError if it is malformed.
    """
    if not path.exists():
        message = "is missing; make a first one with: semgrid-eval convert ros2 BAG --inspect"
        raise InputError(message, path=path, field="map")
    return parse_config(BagMap, load_yaml(path), path=path)
