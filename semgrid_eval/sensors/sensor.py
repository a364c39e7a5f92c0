"""What every kind of sensor shares: settings in a grid's configuration, and the labelled points that it gives."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semgrid_eval.config import Config

if TYPE_CHECKING:  # whoever reads settings alone needs no reader of logs
    from semgrid_eval.log.reader import LogReader


Morphology = Literal["minkowski", "opencv", "off"]


class SensorConfig(Config):
    """Settings that sensors of all kinds have."""

    kind: str  # one of `semgrid_eval.sensors.kinds.KINDS`
    # What is done to its cells, of each class alone (reading 12). None takes the grid's, and is not written, so that
    # grids of cameras keep their digests.
    morphology: Morphology | None = Field(None, exclude_if=lambda value: value is None)
    max_age_s: float = Field(0.2, ge=0.0, le=10.0)  # what is older at the time of a grid is left out


@dataclass(frozen=True, eq=False)
class Points:
    """What one sensor saw at one time.

    The arrays have one shape, (N,) or, for images, (H, W).
    """

    sensor: str  # its name in the grid's configuration
    stamp_ns: int  # when the points were seen
    # float64, and `left_m`, in the vehicle frame of that time (ISO 8855, origin on the ground under the rear axle).
    forward_m: NDArray[np.float64]
    left_m: NDArray[np.float64]
    class_id: NDArray[np.uint8]  # where it is `NO_POINT` there is nothing, whatever the coordinates say


TopicOf = Callable[["LogReader", Any], str]
ReadPoints = Callable[["LogReader", Mapping[str, Any], NDArray[np.uint8]], Iterator[Points]]


@dataclass(frozen=True)
class Kind:
    """A kind of sensor."""

    config: type[SensorConfig]  # class of its settings
    # Takes an open log, the settings of all sensors of the kind by name, and the table (256,) from label id to grid
    # class, and iterates over all that they saw in the order of time. Sensors that share data come together, so that it
    # is read and decoded once.
    read: ReadPoints
    # Takes an open log and the settings of one sensor, and returns the topic whose messages have the times of what it
    # saw. None where no topic does: whoever asks for the times reads the points.
    topic: TopicOf | None = None
