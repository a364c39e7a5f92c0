"""A stream as a viewer would have seen it: answers from their publication on, where the row says that they lie."""

import heapq
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.grids.extent import extent_of
from semgrid_eval.log import topics
from semgrid_eval.log.codec import transforms_message
from semgrid_eval.log.grids import CERTAINTY, CLASSES, MASK, GridPlace, exact_message, viewer_message
from semgrid_eval.log.predictions import Prediction, prediction_message
from semgrid_eval.playback.backdrop import Backdrop, Outgoing, prediction_topic
from semgrid_eval.playback.scored import Scored
from semgrid_eval.recording.types import Pose
from semgrid_eval.streams.config import StreamConfig


class LiveMessages:
    """The messages of the recording that a stream keeps; log times are those at which a viewer sees them.

    An answer is drawn when it is published and again at each time of evaluation at which it is the newest, in the
    vehicle's place then: shifted by the way since the time that it is for where the row moves answers, and as it is
    where it does not. It is drawn where it lies and not rounded to cells, as scores are. The exact message of an answer
    is written once.
    """

    def __init__(self, scored: Scored, stream: StreamConfig, backdrop: Backdrop | None) -> None:
        self._scored, self._arrays, self._stream, self._backdrop = scored, scored.arrays, stream, backdrop
        self._place = extent_of(scored.grid.spec).place
        self._notes, self._topic = {"row": scored.row.name}, prediction_topic(scored.row.name)
        self.first_ns, self.last_ns = (int(self._arrays["evaluated_ns"][i]) for i in (0, -1))

    def messages(self, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over all messages in the order of time, all times shifted."""
        parts = (self._around(shift_ns), self._truth(shift_ns), self._answers(shift_ns))
        return heapq.merge(*parts, key=lambda sent: sent.log_ns)

    def _around(self, shift_ns: int) -> Iterator[Outgoing]:
        if self._backdrop is None:  # nothing is known of the vehicle's heading: grids are drawn around it
            for now_ns in self._arrays["evaluated_ns"]:
                now = Pose(int(now_ns) + shift_ns, 0.0, 0.0, 0.0)
                yield Outgoing(now.stamp_ns, topics.TRANSFORMS, transforms_message(now, {}))
            return
        yaw_rad = self._backdrop.poses[self._backdrop.frame_at(self.first_ns)].yaw_rad
        yield from self._backdrop.messages(self.first_ns, self.last_ns, shift_ns=shift_ns, grid_yaw_rad=yaw_rad)

    def _truth(self, shift_ns: int) -> Iterator[Outgoing]:
        layers = ((topics.GRID_TARGET, "target", CLASSES), (topics.GRID_MASK, "mask", MASK))
        for number, evaluated_ns in enumerate(self._arrays["evaluated_ns"]):
            now_ns = int(evaluated_ns) + shift_ns
            for topic, name, layer in layers:
                values = self._arrays[name][number]
                yield Outgoing(now_ns, topic, viewer_message(now_ns, values, layer, self._place), now_ns, self._notes)
                exact = exact_message(now_ns, values, layer, self._place)
                yield Outgoing(now_ns, f"{topic}/exact", exact, now_ns, self._notes)

    def _answers(self, shift_ns: int) -> Iterator[Outgoing]:
        arrays, shown = self._arrays, -1
        for time_ns, number, position_m in self._instants():
            if number != shown:
                shown = number
                yield self._exact(number, time_ns, shift_ns)
            away_m = arrays["answer_m"][number] - position_m if self._stream.move else np.zeros(2)
            place = GridPlace(
                self._place.cell_m, self._place.corner_x_m + away_m[0], self._place.corner_y_m + away_m[1]
            )
            now_ns, published_ns = time_ns + shift_ns, int(arrays["publish_ns"][number]) + shift_ns
            for topic, name, layer in (
                (self._topic, "prediction", CLASSES),
                (topics.GRID_CERTAINTY, "certainty", CERTAINTY),
            ):
                message = viewer_message(now_ns, arrays[name][number], layer, place)
                yield Outgoing(now_ns, topic, message, published_ns, self._notes)

    def _instants(self) -> list[tuple[int, int, NDArray[np.float64]]]:
        """List when which answer is drawn, with the vehicle's position then, in the order of time.

        What is predicted anew for each time of evaluation is there at that time alone.
        """
        arrays = self._arrays
        there = np.flatnonzero(arrays["used"] >= 0)
        found = [(int(arrays["evaluated_ns"][e]), int(arrays["used"][e]), arrays["evaluated_m"][e]) for e in there]
        if self._stream.asked != "exact":
            evaluated = {(time_ns, number) for time_ns, number, _ in found}
            published = zip(
                arrays["publish_ns"].tolist(), range(len(arrays["publish_ns"])), arrays["publish_m"], strict=True
            )
            found += [each for each in published if each[:2] not in evaluated]
        return sorted(found, key=lambda each: each[:2])

    def _exact(self, number: int, time_ns: int, shift_ns: int) -> Outgoing:
        arrays = self._arrays
        prediction = Prediction(
            arrays["prediction"][number],
            for_ns=int(arrays["for_ns"][number]) + shift_ns,
            capture_ns=int(arrays["capture_ns"][number]) + shift_ns,
            publish_ns=time_ns + shift_ns,
            certainty=arrays["certainty"][number],
        )
        message = prediction_message(prediction, self._place)
        return Outgoing(prediction.publish_ns, f"{self._topic}/exact", message, prediction.publish_ns, self._notes)
