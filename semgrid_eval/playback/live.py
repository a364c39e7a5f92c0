"""Streams as a viewer would have seen them: answers from their publication on, where their row says that they lie."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.config import parse_config
from semgrid_eval.grids.extent import place_of
from semgrid_eval.log import topics
from semgrid_eval.log.codec import transforms_message
from semgrid_eval.log.grids import CERTAINTY, MASK, class_layer
from semgrid_eval.log.predictions import Prediction
from semgrid_eval.playback.backdrop import Backdrop
from semgrid_eval.playback.outgoing import GridTopic, Outgoing, opening
from semgrid_eval.playback.scored import Scored
from semgrid_eval.recording.types import Pose
from semgrid_eval.streams.config import StreamConfig


class PlayedStreams:
    """The messages of the recording that streams keep; log times are those at which a viewer sees them.

    Rows are numbered from 1 in their order; targets and M are those of the first one's times of evaluation.
    """

    def __init__(self, rows: Sequence[Scored], backdrop: Backdrop | None) -> None:
        self._first, self._backdrop = rows[0], backdrop
        self._streams = [_Stream(number, row) for number, row in enumerate(rows, start=1)]
        self._evaluated_ns = np.unique(np.concatenate([row.arrays["evaluated_ns"] for row in rows]))
        self.first_ns, self.last_ns = (int(self._evaluated_ns[i]) for i in (0, -1))

    def messages(self, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over all messages in the order of time, all times shifted."""
        names = tuple(stream.name for stream in self._streams)
        first = opening(self.first_ns + shift_ns, names, self._first.grid)
        answers = (stream.answers(shift_ns) for stream in self._streams)
        parts = (first, self._around(shift_ns), self._truth(shift_ns), *answers)
        return heapq.merge(*parts, key=lambda sent: sent.log_ns)

    def _around(self, shift_ns: int) -> Iterator[Outgoing]:
        if self._backdrop is None:  # nothing is known of the vehicle's heading: grids are drawn around it
            for now_ns in self._evaluated_ns:
                now = Pose(int(now_ns) + shift_ns, 0.0, 0.0, 0.0)
                yield Outgoing(now.stamp_ns, topics.TRANSFORMS, transforms_message(now, {}))
            return
        yaw_rad = self._backdrop.poses[self._backdrop.frame_at(self.first_ns)].yaw_rad
        yield from self._backdrop.messages(self.first_ns, self.last_ns, shift_ns=shift_ns, grid_yaw_rad=yaw_rad)

    def _truth(self, shift_ns: int) -> Iterator[Outgoing]:
        arrays, place = self._first.arrays, place_of(self._first.grid.spec)
        shown = GridTopic(topics.GRID_TARGET, class_layer(self._first.grid.classes), {})
        left_out = GridTopic(f"{topics.GRID_MASK}/1", MASK, {"row": self._first.row.name})
        for evaluated_ns, target, mask in zip(*(arrays[each] for each in _TRUTH), strict=True):
            now_ns = int(evaluated_ns) + shift_ns
            for topic, values in ((shown, target), (left_out, mask)):
                yield topic.shown(now_ns, now_ns, values, place)
                yield topic.exact(now_ns, now_ns, values, place)
            yield shown.picture(now_ns, now_ns, target, mask)


_TRUTH = ("evaluated_ns", "target", "mask")


class _Stream:
    """The answers of one row.

    An answer is drawn when it is published and again at each time of evaluation at which it is the newest, in the
    vehicle's place then: shifted by the way since the time that it is for where the row moves answers, and as it is
    where it does not. It is drawn where it lies and not rounded to cells, as scores are. The exact message of an answer
    is written once.
    """

    def __init__(self, number: int, scored: Scored) -> None:
        self.name, self._arrays = scored.row.name, scored.arrays
        self._how = parse_config(StreamConfig, scored.record.config.get("stream"))
        self._place, self._is_unsure = place_of(scored.grid.spec), scored.is_unsure
        notes = {"row": self.name}
        self._answer = GridTopic(f"{topics.GRID_PREDICTION}/{number}", class_layer(scored.grid.classes), notes)
        self._certainty = GridTopic(f"{topics.GRID_CERTAINTY}/{number}", CERTAINTY, notes)

    def answers(self, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over the messages of all answers in the order of time, all times shifted."""
        arrays, shown = self._arrays, -1
        for time_ns, number, position_m in self._instants:
            if number != shown:
                shown = number
                yield self._exact(number, time_ns, shift_ns)
            away_m = arrays["answer_m"][number] - position_m if self._how.move else np.zeros(2)
            corner = (self._place.corner_x_m + away_m[0], self._place.corner_y_m + away_m[1])
            place = replace(self._place, corner_x_m=corner[0], corner_y_m=corner[1])
            times_ns = (time_ns + shift_ns, int(arrays["publish_ns"][number]) + shift_ns)
            yield self._answer.shown(*times_ns, arrays["prediction"][number], place)
            yield self._answer.picture(*times_ns, arrays["prediction"][number])
            if self._is_unsure:
                yield self._certainty.shown(*times_ns, arrays["certainty"][number], place)
                yield self._certainty.picture(*times_ns, arrays["certainty"][number])

    @cached_property
    def _instants(self) -> list[tuple[int, int, NDArray[np.float64]]]:
        """When which answer is drawn, with the vehicle's position then, in the order of time.

        What is predicted anew for each time of evaluation is there at that time alone.
        """
        arrays: dict[str, Any] = self._arrays
        there = np.flatnonzero(arrays["used"] >= 0)
        found = [(int(arrays["evaluated_ns"][e]), int(arrays["used"][e]), arrays["evaluated_m"][e]) for e in there]
        if self._how.asked != "exact":
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
            certainty=arrays["certainty"][number] if self._is_unsure else None,
        )
        return self._answer.prediction(prediction, self._place, prediction.publish_ns)
