"""Messages to write: the forms in which one grid goes out."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from google.protobuf.message import Message

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.grids import GridLayer, GridPlace, exact_message, viewer_message
from semgrid_eval.log.predictions import Prediction, prediction_message
from semgrid_eval.log.topics import GRID_LEGEND, GRID_PREDICTION
from semgrid_eval.playback.pictures import Grid, grid_picture, legend, row_name


class Outgoing(NamedTuple):
    """A message to write, with the arguments of `MessageWriter.write`."""

    log_ns: int
    topic: str
    message: Message
    publish_ns: int | None = None
    notes: dict[str, str] | None = None


@dataclass(frozen=True)
class GridTopic:
    """Where the grids of one kind go out: for viewers that draw grids, as a picture and, below `/exact`, as scored."""

    topic: str
    layer: GridLayer
    notes: dict[str, str]  # metadata of the channels

    def shown(self, now_ns: int, publish_ns: int, values: Grid, place: GridPlace) -> Outgoing:
        """Draw a grid (H, W) where it lies."""
        message = viewer_message(now_ns, values, self.layer, place)
        return Outgoing(now_ns, self.topic, message, publish_ns, self.notes)

    def picture(self, now_ns: int, publish_ns: int, values: Grid, mask: Grid | None = None) -> Outgoing:
        """Draw a grid (H, W) as a picture."""
        message = grid_picture(now_ns, values, self.layer, mask)
        return Outgoing(now_ns, f"{self.topic}/picture", message, publish_ns, self.notes)

    def exact(self, now_ns: int, publish_ns: int, values: Grid, place: GridPlace) -> Outgoing:
        """Write the ids of a grid (H, W)."""
        message = exact_message(now_ns, values, self.layer, place)
        return Outgoing(now_ns, f"{self.topic}/exact", message, publish_ns, self.notes)

    def prediction(self, prediction: Prediction, place: GridPlace, now_ns: int) -> Outgoing:
        """Write the ids of a prediction, with its certainty if it has one and the times that it tells."""
        message = prediction_message(prediction, self.layer, place)
        return Outgoing(now_ns, f"{self.topic}/exact", message, prediction.publish_ns, self.notes)


def opening(now_ns: int, rows: tuple[str, ...], grid: GridConfig) -> Iterator[Outgoing]:
    """Write what is said once: the legend, and the name of each row beside its prediction."""
    yield Outgoing(now_ns, GRID_LEGEND, legend(now_ns, rows, grid.classes))
    for number, name in enumerate(rows, start=1):
        yield Outgoing(
            now_ns, f"{GRID_PREDICTION}/{number}/name", row_name(now_ns, name, grid.spec), notes={"row": name}
        )
