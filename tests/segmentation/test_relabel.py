import json
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

from support.coloured import TRAIN_COLOURS, coloured, expected_labels
from support.driving import driving
from support.onnx_models import FLAT, colour_network

from semgrid_eval.errors import InputError
from semgrid_eval.log.convert import Work
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.relabel import RECORD, segment_logs

CONFIG = SegmentationConfig(**FLAT)


@pytest.fixture
def model(tmp_path):
    return colour_network(tmp_path / "network.onnx", colours=TRAIN_COLOURS)


@pytest.fixture
def logs(tmp_path):
    """A folder of two logs."""
    for name in ("a", "b"):
        write_log(replace(coloured(), name=name), tmp_path / f"logs/val/{name}.mcap")
    return tmp_path / "logs"


def segment(logs, model, config=CONFIG, *, workers=1):
    return segment_logs(logs, model, config, model.with_name("labelled"), Work(workers))


def moments(path):
    return list(read_recording(path).moments())


def labels(path, camera="front"):
    frames = (moment.cameras[camera] for moment in moments(path))
    return [None if frame.label_png is None else decode_gray(frame.label_png, bit_depth=8) for frame in frames]


@pytest.mark.parametrize("workers", [1, 2])
def test_logs_get_the_labels_that_the_network_gives(logs, model, tmp_path, workers):
    summary = segment([logs], model, workers=workers)
    assert (summary.written, summary.skipped, summary.failed) == (["val/a", "val/b"], [], {})
    for path in find_logs(tmp_path / "labelled"):
        for number, found in enumerate(labels(path)):
            assert np.array_equal(found, expected_labels(number))


def test_all_else_is_kept(logs, model, tmp_path):
    segment([logs], model)
    old, new = logs / "val/a.mcap", tmp_path / "labelled/val/a.mcap"
    for before, after in zip(moments(old), moments(new), strict=True):
        label_png = after.cameras["front"].label_png
        frames = {"front": replace(before.cameras["front"], label_png=label_png)}
        assert after == replace(before, cameras=frames)
    before, after = read_recording(old), read_recording(new)
    assert after.calibrations == before.calibrations
    assert (after.name, after.dataset, after.split) == (before.name, before.dataset, before.split)
    assert {name: data for name, data in after.source_files.items() if name != RECORD} == before.source_files


def test_log_says_what_made_its_labels(logs, model, tmp_path):
    segment([logs], model)
    with LogReader(logs / "val/a.mcap") as source, LogReader(tmp_path / "labelled/val/a.mcap") as log:
        record = json.loads(log.attachments()[RECORD])
        assert record["log_digest"] == source.digest
        assert log.scene.source_digest != source.scene.source_digest
    assert record["model"] == "network.onnx"
    assert record["config"]["mean"] == [0.0, 0.0, 0.0]
    assert (record["classes"], record["device"]) == ("cityscapes", "cpu")
    assert (record["labels"][0], record["labels"][13], len(record["labels"])) == ("road", "car", 19)


def test_every_camera_gets_labels(model, tmp_path):
    write_log(coloured(driving(frames=2, cameras=("rear", "front"))), tmp_path / "logs/two.mcap")
    segment([tmp_path / "logs"], model)
    for camera in ("front", "rear"):
        found = labels(tmp_path / "labelled/val/street.mcap", camera)
        assert np.array_equal(found, [expected_labels(number, camera) for number in range(2)])


def test_frame_without_image_loses_its_label(model, tmp_path):
    write_log(coloured(without=(0, 2)), tmp_path / "logs/some.mcap")
    segment([tmp_path / "logs"], model)
    found = labels(tmp_path / "labelled/val/street.mcap")
    assert [label is None for label in found] == [True, False, True, False]


def test_log_without_images_fails_and_leaves_nothing(logs, model, tmp_path):
    write_log(replace(coloured(without=tuple(range(4))), name="blind"), logs / "val/blind.mcap")
    summary = segment([logs], model)
    assert summary.written == ["val/a", "val/b"]
    assert summary.failed == {"val/blind": "blind: has no colour image"}
    assert [path.stem for path in find_logs(tmp_path / "labelled")] == ["a", "b"]


def test_damaged_log_is_named_and_the_rest_goes_on(logs, model):
    (logs / "val/c.mcap").write_bytes((logs / "val/a.mcap").read_bytes()[:-9])
    summary = segment([logs], model)
    assert summary.written == ["val/a", "val/b"]
    assert list(summary.failed) == ["val/c"]
    assert "c.mcap: is damaged" in summary.failed["val/c"]


def test_second_time_nothing_is_written(logs, model, tmp_path):
    segment([logs], model)
    before = (tmp_path / "labelled/val/a.mcap").stat().st_mtime_ns
    (tmp_path / "network.onnx.folder").mkdir()  # no weights
    assert segment([logs], model).skipped == ["val/a", "val/b"]
    assert (tmp_path / "labelled/val/a.mcap").stat().st_mtime_ns == before


def test_changed_log_alone_is_written_again(logs, model):
    segment([logs], model)
    write_log(replace(coloured(driving(frames=3)), name="a"), logs / "val/a.mcap")
    summary = segment([logs], model)
    assert (summary.written, summary.skipped) == (["val/a"], ["val/b"])


@pytest.mark.parametrize("change", ["model", "weights beside it", "option", "class map"])
def test_changed_model_or_option_makes_all_anew(logs, model, change):
    segment([logs], model)
    config = CONFIG
    if change == "model":
        colour_network(model, colours={**TRAIN_COLOURS, 2: (0.0, 1.0, 0.0)})
    elif change == "class map":
        (model.parent / "own.yaml").write_text("{base: cityscapes, classes: {road: parking}}")
        config = SegmentationConfig(**FLAT, classes=str(model.parent / "own.yaml"))
    elif change == "option":
        config = SegmentationConfig(**{**FLAT, "upsample": "nearest"})
    else:
        model.with_name("network.onnx.data").write_bytes(b"1")
    assert segment([logs], model, config).written == ["val/a", "val/b"]


def test_same_input_gives_the_same_bytes(logs, model, tmp_path):
    segment([logs], model)
    path = tmp_path / "labelled/val/a.mcap"
    before = path.read_bytes()
    path.unlink()
    segment([logs], model, workers=2)
    assert path.read_bytes() == before


def test_single_logs_can_be_given(logs, model):
    assert segment([logs / "val/b.mcap"], model).written == ["val/b"]


def test_model_that_cannot_be_used_is_one_error(logs, model):
    model.write_bytes(b"none")
    with pytest.raises(InputError, match=r"network\.onnx: is not a model that can be used"):
        segment([logs], model)


def test_failure_of_the_network_is_a_failure_of_the_log(logs, model):
    colour_network(model, classes=34, colours={7: (1, 0, 0), 26: (0, 0, 1)}, ids=np.int64)
    summary = segment([logs], model)
    assert list(summary.failed) == ["val/a", "val/b"]
    assert summary.failed["val/a"].endswith(
        "network.onnx: answer: gives the id 26, which is not one of the 19 classes of cityscapes"
    )


@pytest.mark.parametrize("out", ["logs", ".", "logs/labelled"])
def test_new_logs_are_kept_apart_from_the_old(logs, model, tmp_path, out):
    whole = (logs / "val/a.mcap").read_bytes()
    with pytest.raises(InputError, match=r"out: contains or is inside .*; new logs need a folder of their own"):
        segment_logs([logs], model, CONFIG, tmp_path / out)
    with pytest.raises(InputError, match=r"out: contains or is inside .*; new logs need a folder of their own"):
        segment_logs([logs / "val/a.mcap"], model, CONFIG, tmp_path / "logs")
    assert (logs / "val/a.mcap").read_bytes() == whole


def test_two_logs_of_one_name_are_refused(logs, model, tmp_path):
    write_log(replace(coloured(), name="a"), tmp_path / "more/a.mcap")
    with pytest.raises(InputError, match="val/a: two recordings have this name"):
        segment([logs, tmp_path / "more"], model)


def test_progress_names_every_log(logs, model):
    told = []
    work = Work(stage=lambda label: nullcontext(lambda *call: told.append(call)))
    segment_logs([logs], model, CONFIG, model.with_name("labelled"), work)
    assert told == [(1, 2, "val/a"), (2, 2, "val/b")]
