"""Predictions in logs, whoever made them: grids, each with the three times by which a stream is scored."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from semgrid_eval.classes import ClassSet
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import atomic_file
from semgrid_eval.log.codec import PREDICTIONS_RECORD, stamp_ns, timestamp
from semgrid_eval.log.container import MAX_STAMP_NS, Container, Entry
from semgrid_eval.log.grids import GridLayer, GridPlace, class_layer, exact_message
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid
from semgrid_eval.log.topics import GRID_PREDICTION
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.words import plural

RECORDING = "recording"
"""The entry of its metadata record that names the recording which the predictions belong to."""
SCHEMA = SemanticGrid.DESCRIPTOR.full_name
TOPIC = f"{GRID_PREDICTION}/exact"
"""Where `write_predictions` writes."""
Values = NDArray[np.uint8]


class GridExtent(NamedTuple):
    """Size of grids in cells, where they are, and their classes."""

    rows: int
    columns: int
    place: GridPlace
    classes: ClassSet


@dataclass(frozen=True, eq=False)
class Prediction:
    """A grid that was predicted; it lies where the vehicle is at `for_ns`, in the orientation of its recording."""

    classes: Values  # (H, W) class ids, row 0 farthest ahead, column 0 farthest left
    for_ns: int  # the time that it is for
    capture_ns: int  # capture of the newest input that was used
    publish_ns: int  # when it was there
    certainty: Values | None = None  # (H, W) of its class, 255 = 1; certain everywhere where it does not say


def prediction_message(prediction: Prediction, layer: GridLayer, place: GridPlace) -> SemanticGrid:
    """Write a prediction as a message, without its publication, which is the message's own."""
    message = exact_message(prediction.for_ns, prediction.classes, layer, place)
    message.capture_time.CopyFrom(timestamp(prediction.capture_ns))
    if prediction.certainty is not None:
        message.certainty = np.ascontiguousarray(prediction.certainty, np.uint8).tobytes()
    return message


def write_predictions(path: Path, predictions: Iterable[Prediction], recording: str, extent: GridExtent) -> int:
    """Write the predictions of one recording, in the order of their publication, as a log; return how many.

    Raises:
        InputError: there is none, one is of another size, has ids that are not classes, or times that cannot be.
    """
    count, before_ns, layer = 0, 0, class_layer(extent.classes)
    with atomic_file(path) as stream, MessageWriter(stream) as writer:
        writer.metadata(PREDICTIONS_RECORD, {RECORDING: recording})
        for prediction in predictions:
            fault = _fault_of_values(prediction, extent) or _fault_of_times(prediction, before_ns)
            if fault:
                raise InputError(fault, path=path, field=f"prediction for {prediction.for_ns} ns")
            before_ns, count = prediction.publish_ns, count + 1
            writer.write(TOPIC, prediction_message(prediction, layer, extent.place), log_ns=prediction.publish_ns)
        if not count:
            raise InputError("there is no prediction to write", path=path)
    return count


class PredictionLog(Container):
    """A log that holds predictions; `recording` is what its record says that they belong to, or else its name.

    Raises:
        LogError: as a container does, and where its record names no recording.
    """

    def __init__(self, path: Path, topic: str | None = None) -> None:
        super().__init__(path)
        self._wanted = topic
        try:
            record = self.metadata(PREDICTIONS_RECORD)
            if record is not None and not record.get(RECORDING):
                raise LogError("names no recording", path=path, field=f"metadata {PREDICTIONS_RECORD}: {RECORDING}")
        except BaseException:
            self.close()
            raise
        self.recording = record[RECORDING] if record else path.stem

    @cached_property
    def topic(self) -> str:
        """The topic that is asked for; else the one that holds grids, of several the one below `/grid/prediction`.

        Raises:
            LogError: there is no such topic, or there are several.
        """
        schemas = {number for number, each in self.summary.schemas.items() if each.name == SCHEMA}
        channels = self.summary.channels.values()
        found = sorted({each.topic for each in channels if each.schema_id in schemas})
        if self._wanted is not None:
            if self._wanted not in found:
                raise LogError(f"holds no {SCHEMA}, only {_listed(found)}", path=self.path, field=self._wanted)
            return self._wanted
        below = [topic for topic in found if topic.startswith(f"{GRID_PREDICTION}/")]
        chosen = found if len(found) == 1 else below
        if not found:
            raise LogError(f"holds no {SCHEMA}", path=self.path, field="topic")
        if len(chosen) != 1:
            raise LogError(f"holds {SCHEMA} as {_listed(chosen or found)}: name one", path=self.path, field="topic")
        return chosen[0]

    def predictions(self, extent: GridExtent) -> Iterator[Prediction]:
        """Iterate over the predictions in the order of the log.

        Raises:
            LogError: there is none; one is damaged, or of another extent or list of classes; one is published before
                its capture, or before the one that precedes it in the log.
        """
        before_ns = -1
        for entry in self.messages([self.topic]):
            prediction = self._decoded(entry, extent)
            if fault := _fault_of_times(prediction, before_ns):
                raise self._error(entry, fault)
            before_ns = prediction.publish_ns
            yield prediction
        if before_ns < 0:
            raise LogError("has no message", path=self.path, field=self.topic)

    def _decoded(self, entry: Entry, extent: GridExtent) -> Prediction:
        try:
            message = SemanticGrid.FromString(entry.data)
            if fault := _fault_of_message(message, extent):
                raise self._error(entry, fault)
            for_ns, capture_ns = stamp_ns(message.timestamp), stamp_ns(message.capture_time)
        except (DecodeError, ValueError) as error:
            raise self._error(entry, f"is damaged: {error}") from error
        shape = (extent.rows, extent.columns)
        certainty = np.frombuffer(message.certainty, np.uint8).reshape(shape) if message.certainty else None
        classes = np.frombuffer(message.class_ids, np.uint8).reshape(shape)
        return Prediction(classes, for_ns, capture_ns, entry.publish_ns, certainty)

    def _error(self, entry: Entry, fault: str) -> LogError:
        return LogError(fault, path=self.path, field=f"{entry.topic} at {entry.log_ns} ns")


def _fault_of_message(message: SemanticGrid, extent: GridExtent) -> str | None:
    """Say why a message is not a prediction of grids of this extent; nothing is allocated before."""
    cells = extent.rows * extent.columns
    if fault := _fault_of_extent(message, extent):
        return fault
    if fault := _fault_of_names(tuple(message.class_names), extent.classes.names):
        return f"class_names: {fault}"
    for name, size in (("class_ids", len(message.class_ids)), ("certainty", len(message.certainty) or cells)):
        if size != cells:
            return f"{name}: {size} bytes, and {cells} cells need as many"
    if fault := _fault_of_ids(max(message.class_ids), extent.classes):
        return f"class_ids: {fault}"
    missing = [name for name in ("timestamp", "capture_time") if not message.HasField(name)]
    return f"{missing[0]}: is missing" if missing else None


def _fault_of_extent(message: SemanticGrid, extent: GridExtent) -> str | None:
    size, place = (extent.rows, extent.columns), extent.place
    if (message.rows, message.columns) != size:
        return f"rows, columns: {message.rows} x {message.columns} cells, and {size[0]} x {size[1]} are scored"
    scored = {"cell_size_m": place.cell_m, "corner_x_m": place.corner_x_m, "corner_y_m": place.corner_y_m}
    for name, value_m in scored.items():
        found_m = getattr(message, name)
        if not np.isclose(found_m, value_m, rtol=1e-6, atol=1e-9):
            return f"{name}: {found_m:g} m, and {value_m:g} m is scored"
    return None


def _fault_of_names(names: tuple[str, ...], scored: tuple[str, ...]) -> str | None:
    for number, (name, known) in enumerate(zip(names, scored, strict=False)):
        if name != known:
            return f"class {number} is {name!r}, and {known!r} is scored"
    return (
        None if len(names) == len(scored) else f"{plural(len(names), 'class', 'classes')}, and {len(scored)} are scored"
    )


def _fault_of_ids(largest: int, classes: ClassSet) -> str | None:
    return f"{largest} is not a class, which are 0 to {classes.count - 1}" if largest >= classes.count else None


def _fault_of_values(prediction: Prediction, extent: GridExtent) -> str | None:
    shape = (extent.rows, extent.columns)
    for name, values in (("classes", prediction.classes), ("certainty", prediction.certainty)):
        if values is None:
            continue
        if values.shape != shape or values.dtype != np.uint8:
            return f"{name}: {values.dtype} {values.shape}, and uint8 {shape} is needed"
    fault = _fault_of_ids(int(prediction.classes.max()), extent.classes)
    return f"classes: {fault}" if fault else None


def _fault_of_times(prediction: Prediction, before_ns: int) -> str | None:
    """Say what is wrong with the times of a prediction; `before_ns` is the publication of the one before it."""
    published = f"published at {prediction.publish_ns} ns"
    times_ns = (prediction.publish_ns, prediction.for_ns, prediction.capture_ns)
    if not 0 <= min(times_ns) <= max(times_ns) < MAX_STAMP_NS:
        return f"{published}, for {prediction.for_ns} ns: times below 0, or times of 2^63 ns or more"
    if prediction.publish_ns < prediction.capture_ns:
        return f"{published}, before the capture of its newest input at {prediction.capture_ns} ns"
    if prediction.publish_ns < before_ns:
        return f"{published}, and the one before it at {before_ns} ns: times go back"
    return None


def _listed(topics: list[str]) -> str:
    return ", ".join(topics) or "nothing"
