"""The windows of some rows in one recording as messages, each at the time that its target is for."""

import heapq
from collections.abc import Iterator, Sequence
from itertools import chain

from semgrid_eval.grids.extent import place_of
from semgrid_eval.log import topics
from semgrid_eval.log.codec import transforms_message
from semgrid_eval.log.grids import CERTAINTY, MASK, class_layer
from semgrid_eval.log.predictions import Prediction
from semgrid_eval.playback.backdrop import Backdrop
from semgrid_eval.playback.outgoing import GridTopic, Outgoing, opening
from semgrid_eval.playback.windows import Frame, RowWindows
from semgrid_eval.recording.types import Pose


class PlayedWindows:
    """The messages of one recording, from the first target to the last; rows are numbered from 1 in their order.

    A LogError says that the log lacks the frame of a target.
    """

    def __init__(self, rows: Sequence[RowWindows], backdrop: Backdrop | None) -> None:
        self._rows, self._backdrop = rows, backdrop
        self._place, self._layer = place_of(rows[0].scored.grid.spec), class_layer(rows[0].scored.grid.classes)
        self._measured = GridTopic(topics.GRID_TARGET, self._layer, {})
        self._stamps_ns = sorted({window.target_stamp_ns for row in rows for window in row.windows})
        self.first_ns, self.last_ns = self._stamps_ns[0], self._stamps_ns[-1]

    def messages(self, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over all messages in the order of time, all times shifted."""
        names = tuple(row.scored.row.name for row in self._rows)
        first = opening(self.first_ns + shift_ns, names, self._rows[0].scored.grid)
        return heapq.merge(first, self._around(shift_ns), self._grids(shift_ns), key=lambda sent: sent.log_ns)

    def _around(self, shift_ns: int) -> Iterator[Outgoing]:
        if self._backdrop is None:  # nothing is known of the vehicle's way: each grid lies where the last one did
            for stamp_ns in self._stamps_ns:
                now = Pose(stamp_ns + shift_ns, 0.0, 0.0, 0.0)
                yield Outgoing(now.stamp_ns, topics.TRANSFORMS, transforms_message(now, {}))
            return
        # Grids have the orientation of the first frame of their stretch of the log.
        window = self._rows[0].windows[0]
        first = self._backdrop.frame_at(window.target_stamp_ns) - window.target_frame
        yaw_rad = self._backdrop.poses[first].yaw_rad
        yield from self._backdrop.messages(self.first_ns, self.last_ns, shift_ns=shift_ns, grid_yaw_rad=yaw_rad)

    def _grids(self, shift_ns: int) -> Iterator[Outgoing]:
        numbered = (_numbered(number, row) for number, row in enumerate(self._rows, start=1))
        before_ns = None
        for number, row, frame in heapq.merge(*numbered, key=lambda each: (each[2].window.target_stamp_ns, each[0])):
            if frame.window.target_stamp_ns != before_ns:  # of several rows the first one that predicts it
                before_ns = frame.window.target_stamp_ns
                yield from self._target(frame, shift_ns)
            yield from chain(self._row(number, row, frame, shift_ns), self._inputs(number, row, frame, shift_ns))

    def _target(self, frame: Frame, shift_ns: int) -> Iterator[Outgoing]:
        now_ns = frame.window.target_stamp_ns + shift_ns
        yield self._measured.shown(now_ns, now_ns, frame.target, self._place)
        yield self._measured.exact(now_ns, now_ns, frame.target, self._place)
        yield self._measured.picture(now_ns, now_ns, frame.target, frame.mask)

    def _row(self, number: int, row: RowWindows, frame: Frame, shift_ns: int) -> Iterator[Outgoing]:
        """Write M, which depends on what a row has seen, prediction and certainty."""
        times_ns = (frame.window.target_stamp_ns + shift_ns, frame.window.input_stamps_ns[-1] + shift_ns)
        notes, unsure = {"row": row.scored.row.name}, row.scored.is_unsure
        mask = GridTopic(f"{topics.GRID_MASK}/{number}", MASK, notes)
        answer = GridTopic(f"{topics.GRID_PREDICTION}/{number}", self._layer, notes)
        yield mask.shown(times_ns[0], times_ns[0], frame.mask, self._place)
        yield mask.exact(times_ns[0], times_ns[0], frame.mask, self._place)
        yield answer.shown(*times_ns, frame.prediction, self._place)
        yield answer.picture(*times_ns, frame.prediction)
        certainty = frame.certainty if unsure else None
        prediction = Prediction(frame.prediction, times_ns[0], times_ns[1], times_ns[1], certainty)
        yield answer.prediction(prediction, self._place, times_ns[0])
        if unsure:
            sure = GridTopic(f"{topics.GRID_CERTAINTY}/{number}", CERTAINTY, notes)
            yield sure.shown(*times_ns, frame.certainty, self._place)
            yield sure.picture(*times_ns, frame.certainty)

    def _inputs(self, number: int, row: RowWindows, frame: Frame, shift_ns: int) -> Iterator[Outgoing]:
        now_ns, sensors = frame.window.target_stamp_ns + shift_ns, row.scored.row.facts.sensors
        for place, (sensor, past) in enumerate(zip(sensors, frame.inputs, strict=True), start=1):
            notes = {"row": row.scored.row.name, "sensor": sensor}
            newest_first = zip(past[::-1], frame.window.input_stamps_ns[::-1], strict=True)
            for back, (values, stamp_ns) in enumerate(newest_first):
                topic = f"{topics.GRID_INPUT}/{number}/{place}" + (f"/before_{back}" if back else "")
                seen = GridTopic(topic, self._layer, notes)
                yield seen.shown(now_ns, stamp_ns + shift_ns, values, self._place)
                yield seen.exact(now_ns, stamp_ns + shift_ns, values, self._place)
                if not back:
                    yield seen.picture(now_ns, stamp_ns + shift_ns, values)


def _numbered(number: int, row: RowWindows) -> Iterator[tuple[int, RowWindows, Frame]]:
    return ((number, row, frame) for frame in row.frames())
