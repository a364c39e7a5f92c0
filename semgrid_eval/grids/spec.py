"""What a grid is and how it is made: extent, sensors and the choices that the paper leaves (readings 12 to 22)."""

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from semgrid_eval.classes import CLASS_NAMES, LABEL_ID, NO_POINT, class_map
from semgrid_eval.config import Config

TARGET_SENSOR = "full"
STANDING, MOVING = 1, 2
"""Bits of the flags that say whose footprint a cell lies in."""


class GridSpec(Config):
    """Extent of a grid. Row 0 is farthest ahead, column 0 farthest left (reading 16).

    The vehicle's origin lies on the corner between the cells before and behind `agent_row`, left and right of
    `agent_column`: with the defaults on the bottom edge, laterally centred.
    """

    rows: int = Field(128, ge=8, le=1024)
    columns: int = Field(128, ge=8, le=1024)
    cell_m: float = Field(100.0 / 128.0, gt=0.01, le=10.0)
    agent_row: int = Field(128, ge=0)
    agent_column: int = Field(64, ge=0)

    @model_validator(mode="after")
    def _agent_is_at_the_grid(self) -> Self:
        if self.agent_row > self.rows or self.agent_column > self.columns:
            place = f"{self.agent_row}, {self.agent_column}"
            raise ValueError(f"the agent's cell {place} is outside {self.rows} x {self.columns}")
        return self

    def centres_m(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the cells' centres are from the vehicle: the rows (H,) forward, the columns (W,) left."""
        forward_m = (self.agent_row - np.arange(self.rows, dtype=np.float64) - 0.5) * self.cell_m
        left_m = (self.agent_column - np.arange(self.columns, dtype=np.float64) - 0.5) * self.cell_m
        return forward_m, left_m


class Sensor(Config):
    """A rectangle of the camera image that acts as a sensor of its own; pixels of the resized image, end exclusive."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")
    top_px: int = Field(0, ge=0)
    bottom_px: int
    left_px: int = Field(0, ge=0)
    right_px: int

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if self.bottom_px <= self.top_px or self.right_px <= self.left_px:
            raise ValueError(f"sensor {self.name} covers no pixel")
        return self


class GridConfig(Config):
    """Everything that determines a grid data set, besides the logs.

    Args:
        spec: extent of the grids.
        image_size_px: width and height to which labels and disparity are brought before projection (reading 22).
        camera: name of the camera; None takes a log's only one.
        sensors: crops of the image; None takes the paper's Split 1 and Split 2 by `y_axis`.
        y_axis: where the supplement's rows are counted from, the top (down) or the bottom (up) (reading 19).
        integrator: of the egomotion; euler as the paper, arc for constant turn and speed between samples (reading 17).
        morphology: reading 12.
        stretch_frames: length of a recording; longer logs are cut (reading 18).
        class_map: grid class, or none, by Cityscapes label name; replaces single entries of the default (reading 21).
    """

    spec: GridSpec = GridSpec()
    image_size_px: tuple[int, int] = (512, 256)
    camera: str | None = None
    sensors: tuple[Sensor, ...] | None = None
    y_axis: Literal["down", "up"] = "down"
    integrator: Literal["euler", "arc"] = "euler"
    morphology: Literal["minkowski", "opencv", "off"] = "minkowski"
    stretch_frames: int = Field(30, ge=2, le=100_000)
    class_map: dict[str, str | None] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        width, height = self.image_size_px
        if not (16 <= width <= 8192 and 16 <= height <= 8192):
            raise ValueError(f"image_size_px {width} x {height} is outside 16 to 8192")
        for label, name in self.class_map.items():
            if label not in LABEL_ID:
                raise ValueError(f"class_map: {label!r} is not a Cityscapes label")
            if name is not None and name not in CLASS_NAMES:
                raise ValueError(f"class_map.{label}: {name!r} is not one of {', '.join(CLASS_NAMES)}")
        names = [sensor.name for sensor in self.all_sensors()]
        if len(set(names)) < len(names):
            raise ValueError("sensor names repeat")
        for sensor in self.all_sensors():
            if sensor.bottom_px > height or sensor.right_px > width:
                raise ValueError(f"sensor {sensor.name} reaches beyond the image of {width} x {height} px")
        return self

    def class_by_label(self) -> NDArray[np.uint8]:
        """Return the table (256,) from label id to grid class with this configuration's replacements (reading 21)."""
        table = class_map()
        for label, name in self.class_map.items():
            table[LABEL_ID[label]] = NO_POINT if name is None else CLASS_NAMES.index(name)
        return table

    def all_sensors(self) -> tuple[Sensor, ...]:
        """Return the whole image, which gives the targets, and then the crops."""
        width, height = self.image_size_px
        whole = Sensor(name=TARGET_SENSOR, bottom_px=height, right_px=width)
        return (whole, *(self.sensors if self.sensors is not None else paper_sensors(width, height, self.y_axis)))


def paper_sensors(width: int, height: int, y_axis: Literal["down", "up"]) -> tuple[Sensor, ...]:
    """Return the sensors of Split 1 and Split 2 (supplement; reading 19), given there for 512 x 256 px."""

    def crop(name: str, first_row: int, end_row: int, margin: int) -> Sensor:
        # Rows are those of the paper's image; "up" counts them from the bottom.
        top, bottom = (first_row, end_row) if y_axis == "down" else (256 - end_row, 256 - first_row)
        return Sensor(
            name=name,
            top_px=round(top * height / 256),
            bottom_px=round(bottom * height / 256),
            left_px=round(margin * width / 512),
            right_px=round((512 - margin) * width / 512),
        )

    near, far = ("lower", "upper") if y_axis == "down" else ("upper", "lower")
    return (
        crop(f"split1_{far}", 0, 130, 0),
        crop(f"split1_{near}", 130, 256, 0),
        crop(f"split2_{far}", 0, 125, 40),
        crop(f"split2_{near}", 145, 256, 40),
    )
