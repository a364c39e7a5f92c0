"""Logs of predictions: what is written comes back, and each fault is one line with file, topic, time and value."""

import numpy as np
import pytest
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import Writer
from support.own_classes import class_set

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log.codec import PREDICTIONS_RECORD
from semgrid_eval.log.grids import GridPlace, class_layer, exact_message
from semgrid_eval.log.predictions import (
    TOPIC,
    GridExtent,
    Prediction,
    PredictionLog,
    prediction_message,
    write_predictions,
)
from semgrid_eval.log.writer import MessageWriter

EXTENT = GridExtent(4, 3, GridPlace(0.5, 2.0, 0.5), DEFAULT_CLASSES)
CLASSES = class_layer(DEFAULT_CLASSES)
MS = 1_000_000


def prediction(number=0, **changes):
    random = np.random.default_rng(number)
    classes, certainty = random.integers(0, 10, (4, 3), np.uint8), random.integers(0, 256, (4, 3), np.uint8)
    capture_ns = 10**18 + number * 100 * MS
    made = {"for_ns": capture_ns + 300 * MS, "capture_ns": capture_ns, "publish_ns": capture_ns + 90 * MS}
    return Prediction(**{"classes": classes, "certainty": certainty, **made, **changes})


def write(path, messages, topic=TOPIC, record=None):
    """Write messages as (publish, message, log time)."""
    with path.open("wb") as stream, MessageWriter(stream) as writer:
        if record is not None:
            writer.metadata(PREDICTIONS_RECORD, record)
        for publish_ns, message, *log_ns in messages:
            writer.write(topic, message, log_ns=log_ns[0] if log_ns else publish_ns, publish_ns=publish_ns)
    return path


def read(path, **how):
    with PredictionLog(path, **how) as log:
        return list(log.predictions(EXTENT))


def test_what_is_written_comes_back(tmp_path):
    written = [prediction(0), prediction(1, certainty=None), prediction(2)]
    assert write_predictions(tmp_path / "a.mcap", iter(written), "town/7#2", EXTENT) == 3
    with PredictionLog(tmp_path / "a.mcap") as log:
        assert (log.recording, log.topic) == ("town/7#2", TOPIC)
        found = list(log.predictions(EXTENT))
    for one, other in zip(written, found, strict=True):
        assert (one.for_ns, one.capture_ns, one.publish_ns) == (other.for_ns, other.capture_ns, other.publish_ns)
        np.testing.assert_array_equal(one.classes, other.classes)
    assert found[1].certainty is None
    np.testing.assert_array_equal(found[2].certainty, written[2].certainty)


def test_a_log_without_a_record_belongs_to_the_recording_of_its_name(tmp_path):
    path = write(tmp_path / "drive_7#2.mcap", [(2 * 10**18, prediction_message(prediction(), CLASSES, EXTENT.place))])
    with PredictionLog(path) as log:
        assert log.recording == "drive_7#2"


def test_of_several_topics_the_one_of_predictions_is_taken_or_one_is_named(tmp_path):
    path, at_ns = tmp_path / "a.mcap", 2 * 10**18
    target = exact_message(at_ns, np.zeros((4, 3), np.uint8), CLASSES, EXTENT.place)
    with path.open("wb") as stream, MessageWriter(stream) as writer:
        for topic, message in (
            ("/grid/target/exact", target),
            ("/grid/prediction/a/exact", prediction_message(prediction(1), CLASSES, EXTENT.place)),
            ("/node/out", prediction_message(prediction(2), CLASSES, EXTENT.place)),
        ):
            writer.write(topic, message, log_ns=at_ns)
    assert read(path)[0].capture_ns == prediction(1).capture_ns
    assert read(path, topic="/node/out")[0].capture_ns == prediction(2).capture_ns
    with pytest.raises(LogError, match=r"a.mcap: /nope: holds no semgrid.v1.SemanticGrid, only /grid/pre.*, /node/out"):
        read(path, topic="/nope")


def test_several_topics_of_predictions_are_ambiguous(tmp_path):
    with (tmp_path / "a.mcap").open("wb") as stream, MessageWriter(stream) as writer:
        for topic in ("/a", "/b"):
            writer.write(topic, prediction_message(prediction(), CLASSES, EXTENT.place), log_ns=2 * 10**18)
    with pytest.raises(LogError, match=r"topic: holds semgrid.v1.SemanticGrid as /a, /b: name one"):
        read(tmp_path / "a.mcap")


def names(*changed):
    return [*changed, *CLASS_NAMES[len(changed) :]]


FAULTS = {
    "size": (lambda m: setattr(m, "rows", 5), "rows, columns: 5 x 3 cells, and 4 x 3 are scored"),
    "huge": (
        lambda m: setattr(m, "columns", 4_000_000_000),
        "rows, columns: 4 x 4000000000 cells, and 4 x 3 are scored",
    ),
    "cell": (lambda m: setattr(m, "cell_size_m", 0.25), "cell_size_m: 0.25 m, and 0.5 m is scored"),
    "nan": (lambda m: setattr(m, "cell_size_m", float("nan")), "cell_size_m: nan m, and 0.5 m is scored"),
    "corner": (lambda m: setattr(m, "corner_y_m", 1.5), "corner_y_m: 1.5 m, and 0.5 m is scored"),
    "class": (
        lambda m: (m.ClearField("class_names"), m.class_names.extend(names("sky"))),
        "class_names: class 0 is 'sky', and 'unknown' is scored",
    ),
    "fewer": (lambda m: m.class_names.pop(), "class_names: 9 classes, and 10 are scored"),
    "none": (lambda m: m.ClearField("class_names"), "class_names: 0 classes, and 10 are scored"),
    "ids": (
        lambda m: setattr(m, "class_ids", bytes([3] * 11) + b"\n"),
        "class_ids: 10 is not a class, which are 0 to 9",
    ),
    "short": (lambda m: setattr(m, "class_ids", bytes(11)), "class_ids: 11 bytes, and 12 cells need as many"),
    "certainty": (lambda m: setattr(m, "certainty", bytes(13)), "certainty: 13 bytes, and 12 cells need as many"),
    "capture": (lambda m: m.ClearField("capture_time"), "capture_time: is missing"),
    "time": (lambda m: m.ClearField("timestamp"), "timestamp: is missing"),
    "late": (
        lambda m: m.capture_time.CopyFrom(Timestamp(seconds=10**9, nanos=90 * MS + 1)),
        f"published at {10**18 + 90 * MS} ns, before the capture of its newest input at {10**18 + 90 * MS + 1} ns",
    ),
}


def test_predictions_of_other_classes_than_those_that_are_scored_are_refused(tmp_path):
    own = class_set({"name": "way", "category": "ground", "labels": ["road"]}, categories=[{"name": "ground"}])
    extent = EXTENT._replace(classes=own)
    write_predictions(tmp_path / "a.mcap", [prediction()], "a", EXTENT)
    with (
        PredictionLog(tmp_path / "a.mcap") as log,
        pytest.raises(LogError, match=r"class_names: class 1 is 'road', and 'way' is scored"),
    ):
        list(log.predictions(extent))
    with pytest.raises(InputError, match=r"classes: 9 is not a class, which are 0 to 1"):
        write_predictions(tmp_path / "b.mcap", [prediction(classes=np.full((4, 3), 9, np.uint8))], "a", extent)


@pytest.mark.parametrize("kind", FAULTS)
def test_what_is_no_prediction_of_these_grids_is_refused(tmp_path, kind):
    change, fault = FAULTS[kind]
    message, at_ns = prediction_message(prediction(), CLASSES, EXTENT.place), prediction().publish_ns
    change(message)
    with pytest.raises(LogError) as refused:
        read(write(tmp_path / "a.mcap", [(at_ns, message)], "/node/out"))
    assert str(refused.value).startswith(f"{tmp_path}/a.mcap: /node/out at {at_ns} ns: {fault}")


def test_publication_that_goes_back_in_the_log_is_refused_and_captures_may(tmp_path):
    first_ns = prediction(2).publish_ns
    older, newer = (prediction_message(prediction(number), CLASSES, EXTENT.place) for number in (1, 2))
    path = write(tmp_path / "a.mcap", [(first_ns, newer), (first_ns, older)])
    assert [each.capture_ns for each in read(path)] == [prediction(2).capture_ns, prediction(1).capture_ns]
    path = write(tmp_path / "b.mcap", [(first_ns, newer), (first_ns - 1, older, first_ns + 1)])
    with pytest.raises(LogError) as refused:
        read(path)
    fault = f"published at {first_ns - 1} ns, and the one before it at {first_ns} ns: times go back"
    assert str(refused.value) == f"{path}: {TOPIC} at {first_ns + 1} ns: {fault}"


@pytest.mark.parametrize("record", [{}, {"recording": ""}])
def test_a_record_that_names_no_recording_is_refused(tmp_path, record):
    path = write(tmp_path / "a.mcap", [(1, prediction_message(prediction(), CLASSES, EXTENT.place))], record=record)
    with pytest.raises(LogError, match=r"metadata semgrid.predictions: recording: names no recording"):
        PredictionLog(path)


def test_a_log_without_grids_and_a_message_that_is_none_are_refused(tmp_path):
    (tmp_path / "a.mcap").write_bytes(write(tmp_path / "b.mcap", []).read_bytes())
    with pytest.raises(LogError, match=r"a.mcap: topic: holds no semgrid.v1.SemanticGrid"):
        read(tmp_path / "a.mcap")
    path = write(tmp_path / "c.mcap", [(10**18, Timestamp(seconds=-1))])
    with pytest.raises(LogError, match=r"holds no semgrid.v1.SemanticGrid"):
        read(path)


@pytest.mark.parametrize("cut", [1, 7, 40])
def test_a_message_that_is_cut_is_damage(tmp_path, cut):
    data = prediction_message(prediction(), CLASSES, EXTENT.place).SerializeToString()
    writer = Writer(str(tmp_path / "a.mcap"))
    writer.start()
    schema = writer.register_schema("semgrid.v1.SemanticGrid", "protobuf", b"")
    channel = writer.register_channel("/out", "protobuf", schema)
    writer.add_message(channel, log_time=10**18, publish_time=10**18, data=data[:-cut])
    writer.finish()
    with pytest.raises(LogError, match=r"a.mcap: /out at 1000000000000000000 ns: is damaged: "):
        read(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("wrong", "fault"),
    [
        ({"classes": np.zeros((3, 4), np.uint8)}, r"classes: uint8 \(3, 4\), and uint8 \(4, 3\) is needed"),
        ({"classes": np.zeros((4, 3))}, r"classes: float64 \(4, 3\), and uint8 \(4, 3\) is needed"),
        ({"classes": np.full((4, 3), 10, np.uint8)}, "classes: 10 is not a class, which are 0 to 9"),
        ({"certainty": np.zeros((4, 3))}, r"certainty: float64 \(4, 3\)"),
        ({"publish_ns": 10**17}, "before the capture of its newest input"),
        ({"publish_ns": 1 << 63}, "times of 2\\^63 ns or more"),
        ({"capture_ns": -1}, "times below 0"),
    ],
)
def test_what_cannot_be_read_again_is_not_written(tmp_path, wrong, fault):
    with pytest.raises(InputError, match=fault):
        write_predictions(tmp_path / "a.mcap", [prediction(**wrong)], "one", EXTENT)
    with pytest.raises(InputError, match="there is no prediction to write"):
        write_predictions(tmp_path / "a.mcap", [], "one", EXTENT)
    assert list(tmp_path.iterdir()) == []
