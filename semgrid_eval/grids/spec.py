"""What a grid is and how it is made: extent, sensors and the choices that the paper leaves (readings 12 to 22)."""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from semgrid_eval.classes import DEFAULT_CLASSES, NO_POINT, ClassSet
from semgrid_eval.config import Config
from semgrid_eval.faults import meant, not_one_of
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.motion import Integrator
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.kinds import Sensor, SensorName
from semgrid_eval.sensors.lidar import LidarSensor
from semgrid_eval.sensors.sensor import Morphology, SensorConfig

STANDING, MOVING = 1, 2  # bits of the flags that say whose footprint a cell lies in


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

    def ranges_m(self) -> NDArray[np.float64]:
        """Return how far the cells' centres are from the vehicle: (H, W)."""
        forward_m, left_m = self.centres_m()
        return np.asarray(np.hypot(forward_m[:, None], left_m))


def paper_sensors() -> dict[str, SensorConfig]:
    """Return the whole image and the sensors of Split 1 and Split 2 (supplement; reading 19), of 512 x 256 px."""
    return {
        "full": CameraSensor(),
        "split1_upper": CameraSensor(bottom_px=130),
        "split1_lower": CameraSensor(top_px=130),
        "split2_upper": CameraSensor(bottom_px=125, left_px=40, right_px=472),
        "split2_lower": CameraSensor(top_px=145, left_px=40, right_px=472),
    }


class GridConfig(Config):
    """Everything that determines a grid data set, besides the logs."""

    spec: GridSpec = GridSpec()  # extent of the grids
    sensors: dict[SensorName, Sensor] = Field(default_factory=paper_sensors)  # cameras where `kind` is left out
    # The sensors whose points, counted together, make the targets. The times of the first are the grids'.
    target: tuple[str, ...] = Field(("full",), min_length=1)
    integrator: Integrator = "euler"  # of the egomotion, as in the paper; `EgoMotion` has the other (reading 17)
    morphology: Morphology = "minkowski"  # of sensors that have none of their own; the paper's (reading 12)
    # The classes of cells, as docs/classes.md says; in a file also the path of one, relative to it. The default is not
    # written, so that grids of it keep their digests.
    classes: ClassSet = Field(DEFAULT_CLASSES, exclude_if=lambda classes: classes == DEFAULT_CLASSES)
    stretch_frames: int = Field(30, ge=2, le=100_000)  # longer recordings are cut into stretches (reading 18)
    # Grid class, or none, by Cityscapes label name; replaces single labels of `classes` (reading 21).
    class_map: dict[str, str | None] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        for sensor in self.target:
            if sensor not in self.sensors:
                raise ValueError(f"target: {not_one_of(sensor, self.sensors)}")
        if len(set(self.target)) < len(self.target):
            raise ValueError("target: a sensor repeats")
        for label, name in self.class_map.items():
            if label not in LABEL_ID:
                raise ValueError(f"class_map: {label!r} is not a Cityscapes label{meant(label, LABEL_ID)}")
            if name is not None and name not in self.classes.names:
                raise ValueError(f"class_map.{label}: {not_one_of(name, self.classes.names)}")
        return self

    @property
    def target_row(self) -> str:
        """What the grids of the target are called: by its sensor, or by its sensors, joined."""
        return "+".join(self.target)

    @property
    def rows(self) -> dict[str, tuple[str, ...]]:
        """What there are grids of, each with the sensors whose points are counted together.

        These are the sensors one by one and, where several make it, the target.
        """
        return {**{name: (name,) for name in self.sensors}, self.target_row: self.target}

    @property
    def leader(self) -> SensorConfig:
        """The sensor that leads the target: its times are the grids'."""
        return self.sensors[self.target[0]]

    @property
    def camera(self) -> CameraSensor | None:
        """The part of a camera's image that leads the target; None where a sensor of another kind does."""
        return self.leader if isinstance(self.leader, CameraSensor) else None

    @property
    def camera_beside(self) -> str | None:
        """The first camera that the target, then any sensor, names; where no camera leads it is the one to show."""
        named = (_camera_of(self.sensors[name]) for name in (*self.target, *self.sensors))
        return next((camera for camera in named if camera is not None), None)

    def morphology_of(self, sensor: str) -> Morphology:
        """What is done to the cells of a sensor: its own choice, or the grid's."""
        return self.sensors[sensor].morphology or self.morphology

    @property
    def layers_shape(self) -> tuple[int, int, int]:
        """Of what is counted for each class in each cell: (C, rows, columns)."""
        return self.classes.count, self.spec.rows, self.spec.columns

    def identity(self) -> dict[str, Any]:
        """Return what determines the grids, as JSON values; the default classes, in any colours, are not written."""
        settings = self.model_dump(mode="json", exclude={"classes"})
        return settings if self.classes.means(DEFAULT_CLASSES) else {**settings, "classes": self.classes.identity()}

    def target_identity(self) -> dict[str, object]:
        """Return what determines the targets alone, whatever other sensors there are and what any is called."""
        settings = self.identity()
        sensors = [settings["sensors"][name] for name in self.target]
        return {**settings, "sensors": sensors, "target": len(sensors)}

    def class_by_label(self) -> NDArray[np.uint8]:
        """Return the table (256,) from label id to grid class with this configuration's replacements (reading 21)."""
        table = self.classes.class_by_label()
        for label, name in self.class_map.items():
            table[LABEL_ID[label]] = NO_POINT if name is None else self.classes.names.index(name)
        return table


def _camera_of(sensor: SensorConfig) -> str | None:
    """Return the name of the camera that a sensor is a part of, or of the first that it is coloured by."""
    if isinstance(sensor, CameraSensor):
        return sensor.camera
    return sensor.colour_from.cameras[0] if isinstance(sensor, LidarSensor) and sensor.colour_from else None
