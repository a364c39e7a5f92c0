"""Bad logs of predictions made elsewhere."""

import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from support.bad import small
from support.bad.case import Bad, Kind
from support.toy_world import FRAME_NS, START_NS

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.grids.extent import place_of
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log.codec import PREDICTIONS_RECORD
from semgrid_eval.log.grids import class_layer
from semgrid_eval.log.predictions import TOPIC, Prediction, prediction_message
from semgrid_eval.log.writer import MessageWriter

PLACE, LAYER = place_of(GridSpec()), class_layer(DEFAULT_CLASSES)
LOG = Path("answers/toy1.mcap")
ANSWERS = "model: log, settings: {folder: answers}"


def at(frame: float) -> int:
    """Return the time of a frame."""
    return START_NS + round(frame * FRAME_NS)


def answer(for_frame: float, capture: float, publish: float | None = None) -> Prediction:
    """Return a grid of one class."""
    times = at(for_frame), at(capture), at(capture if publish is None else publish)
    return Prediction(np.full((128, 128), 3, np.uint8), *times)


def whole() -> None:
    """Write good logs, and the answer that the one window of those that are scored needs."""
    small.whole()
    Path("bad.yaml").write_bytes(small.matrix(ANSWERS))
    _write(LOG, [answer(8, 5)])


def _write(
    path: Path,
    answers: Iterable[Prediction],
    change: Callable[..., object] = lambda message: None,
    topic: str = TOPIC,
    record: dict[str, str] | None = None,
) -> None:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as stream, MessageWriter(stream) as writer:
        if record is not None:
            writer.metadata(PREDICTIONS_RECORD, record)
        for place, each in enumerate(answers):
            message = prediction_message(each, LAYER, PLACE)
            change(message)
            writer.write(topic, message, log_ns=START_NS + place, publish_ns=each.publish_ns)


def _changed(words: str, change: Callable[..., object]) -> Bad:
    return Bad(words, small.RUN, spoil=lambda: _write(LOG, [answer(8, 5)], change))


def _set(words: str, name: str, value: object) -> Bad:
    return _changed(words, lambda message: setattr(message, name, value))


def _times(words: str, *answers: Prediction) -> Bad:
    return Bad(words, small.RUN, spoil=lambda: _write(LOG, answers))


def _names(message: object, names: Iterable[str]) -> None:
    message.ClearField("class_names")
    message.class_names.extend(names)


def _other(words: str, spoil: Callable[[], object], row: str = ANSWERS) -> Bad:
    return Bad(words, small.RUN, {"bad.yaml": small.matrix(row)}, spoil)


def _two_topics() -> None:
    with LOG.open("wb") as stream, MessageWriter(stream) as writer:
        for topic in ("/a", "/b"):
            writer.write(topic, prediction_message(answer(8, 5), LAYER, PLACE), log_ns=START_NS)


LATE = Timestamp(seconds=2_000_000_000)
LOGGED = "model: log, settings: {folder: answers, topic: /nowhere}"
KIND = Kind(
    "Logs of predictions",
    "A log in the folder of a row with `model: log`.",
    whole,
    (
        _set("another number of rows", "rows", 64),
        _set("four billion columns", "columns", 4_000_000_000),
        _set("cells of another size", "cell_size_m", 0.25),
        _set("cells of no size", "cell_size_m", float("nan")),
        _set("another corner ahead", "corner_x_m", 1.5),
        _set("another corner to the left", "corner_y_m", 1.5),
        _changed("another list of classes", lambda message: _names(message, ["sky", *CLASS_NAMES[1:]])),
        _changed("a class too few", lambda message: message.class_names.pop()),
        _changed("no list of classes", lambda message: _names(message, [])),
        _set("an id that is no class", "class_ids", bytes([3] * (128 * 128 - 1) + [10])),
        _set("fewer ids than cells", "class_ids", bytes(11)),
        _set("more certainties than cells", "certainty", bytes(128 * 128 + 1)),
        _changed("no time of capture", lambda message: message.ClearField("capture_time")),
        _changed("no time that it is for", lambda message: message.ClearField("timestamp")),
        _changed("a capture after it was published", lambda message: message.capture_time.CopyFrom(LATE)),
        _changed("a time before 1970", lambda message: setattr(message.timestamp, "seconds", -5)),
        _times("published before the one that it follows", answer(8, 5, 7), answer(8, 5, 6)),
        _times("a capture before the recording", answer(8, -1, 5)),
        _times("a capture after the recording", answer(12, 12)),
        _times("for a time before the recording", answer(-1, 2)),
        _times("for a time a minute after the recording", answer(8 + 61e9 / FRAME_NS, 2)),
        _times("nothing for the time of a window", answer(6, 5)),
        _times("for a window, but from a later input", answer(8, 7)),
        _times("no message"),
        _other("no log for a recording", lambda: LOG.rename("answers/toy5.mcap")),
        _other(
            "two logs for a recording",
            lambda: _write(LOG.with_stem("again"), [answer(8, 5)], record={"recording": "toy1"}),
        ),
        _other("a record that names no recording", lambda: _write(LOG, [answer(8, 5)], record={"name": "a"})),
        _other("no such folder", lambda: shutil.rmtree("answers")),
        _other("a folder without logs", LOG.unlink),
        _other("a topic that is not there", lambda: None, LOGGED),
        _other("two topics, none of them named", _two_topics),
        _other("a log without grids", lambda: shutil.copy("logs/val/toy1.mcap", LOG)),
        _other("a log that is cut", lambda: LOG.write_bytes(LOG.read_bytes()[:-100])),
        _other("a log of another grid than the row's", lambda: None, f"{ANSWERS}, grid: {{spec: {{cell_m: 0.5}}}}"),
    ),
)
