"""What is measured is what a live chain does: its grids, inputs and stages; times come from a clock of the test."""

from dataclasses import replace
from itertools import count

import cv2
import numpy as np
import pytest
import torch
from support.coloured import TRAIN_COLOURS
from support.onnx_models import FLAT, colour_network
from support.single import single
from support.toy_world import png, street

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.grids.build import build_log
from semgrid_eval.log.store import write_log
from semgrid_eval.models.model import Model, one_hot
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.streams.chain import Amount, Parts, build_chain, measure_chain, models_for, profile_of
from semgrid_eval.streams.live import GIVEN, GRID, WINDOW, Chain
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import training_windows

FRAMES = 12
WHOLE = FRAMES - WINDOW.span_frames
CPU = torch.device("cpu")


class Watching(Model):
    """Keeps what it is shown."""

    def predict(self, batch):
        self.seen = [*getattr(self, "seen", []), batch]
        return one_hot(batch.past[:, 0, -1])


def ticking(step_ns=1_000_000):
    """A clock that goes on by a millisecond whenever somebody looks."""
    return count(0, step_ns).__next__


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "val" / "toy.mcap"
    write_log(street(1, frames=FRAMES).recording("toy"), path)
    return path


def watched(log, **parts):
    model = Watching(None, GIVEN)
    measured = measure_chain([log], Chain({"mine": model}, CPU, **parts), Amount(100, 0), clock=ticking())
    return model.seen, measured


def test_every_stage_of_every_frame_has_its_time(log):
    measured = watched(log)[1]
    assert measured.stages == {stage: [1.0] * WHOLE for stage in ("decode", "grid", "align")}
    assert measured.models == {"mine": [1.0] * WHOLE}
    assert measured.frames == WHOLE


def test_models_see_what_windows_of_the_log_show(log):
    seen, _ = watched(log)
    data = stack_recordings(build_log(log, GRID), cell_m=GRID.spec.cell_m)
    windows = select_windows(data, training_windows(data.frame_counts, WINDOW).windows, sensors=GIVEN.sensors)
    assert len(seen) > len(windows) > 0  # the last frames have no target in the log
    for number, live in enumerate(seen[: len(windows)]):  # the motion is steady, so that its continuation is the truth
        there = windows.batch(slice(number, number + 1))
        assert torch.equal(live.past, there.past)
        assert torch.equal(live.shift_cells, there.shift_cells)
        torch.testing.assert_close(live.lead_s, there.lead_s, atol=1e-6, rtol=0)
        assert not live.target.any()
    assert (seen[0].past != 0).float().mean() > 0.02


def test_warm_up_and_number_of_frames_count_over_all_logs(log):
    chain = Chain({}, CPU)
    assert measure_chain([log], chain, Amount(100, 3), clock=ticking()).frames == WHOLE - 3
    assert measure_chain([log, log], chain, Amount(100, WHOLE + 2), clock=ticking()).frames == WHOLE - 2
    told = []
    found = measure_chain([log], chain, Amount(2, 1), clock=ticking(), progress=lambda *said: told.append(said))
    assert found.frames == 2
    assert told == [(1, 2, "toy"), (2, 2, "toy")]
    with pytest.raises(InputError, match=rf"warm_up: 7 leaves no frame to measure: the logs hold {WHOLE} frames"):
        measure_chain([log], chain, Amount(2, WHOLE), clock=ticking())


def test_labels_of_a_network_take_the_place_of_those_of_the_log(log, tmp_path):
    file = colour_network(tmp_path / "network.onnx", colours=TRAIN_COLOURS)
    parts = Parts(segment=file, segmentation=SegmentationConfig(**FLAT), threads=1)
    built = build_chain([log], parts)
    seen, measured = watched(log, segmentation=built.chain.segmentation)
    assert list(measured.stages) == ["decode", "segment", "grid", "align"]
    assert measured.stages["segment"] == [1.0] * WHOLE
    road_or_car = {0, *np.unique(GRID.class_by_label()[[7, 26]]).tolist()}
    assert set(torch.cat([batch.past for batch in seen]).unique().tolist()) <= road_or_car


def with_right_images(log, folder, *, frames=FRAMES):
    """Write a log with left images, and right ones into the folder: textures where the log says that they lie."""
    recording = street(1, frames=FRAMES).recording("toy")
    noise = np.random.default_rng(0).standard_normal((128, 256)).astype(np.float32)
    right = np.clip(128 + 200 * cv2.GaussianBlur(noise, (0, 0), 1.2), 0, 255).astype(np.uint8)
    right = np.repeat(right[..., None], 3, axis=2)
    rows, columns = np.indices((128, 256), np.float32)

    def moments():
        for moment in recording.moments():
            frame = moment.cameras["front"]
            disparity_px = np.maximum(decode_gray(frame.disparity_png, bit_depth=16).astype(np.float32) - 1, 0) / 256
            left = cv2.remap(right, columns - disparity_px, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
            yield replace(moment, cameras={"front": replace(frame, image_file=png(left))})

    write_log(replace(recording, moments=moments), log)
    (folder / "toy").mkdir(parents=True)
    for number in range(frames):
        (folder / "toy" / f"{number:03d}.png").write_bytes(png(right))
    return folder


def test_disparity_is_matched_where_there_are_right_images(tmp_path):
    log = tmp_path / "toy.mcap"
    right = with_right_images(log, tmp_path / "right")
    seen, measured = watched(log, right=right)
    assert list(measured.stages) == ["decode", "match", "grid", "align"]
    matched = torch.cat([batch.past for batch in seen])
    told = torch.cat([batch.past for batch in watched(log)[0]])
    both = (matched != 0) & (told != 0)
    assert both.sum() > 0.5 * (told != 0).sum()
    assert (matched == told)[both].float().mean() > 0.8
    assert not torch.equal(matched, told)


def test_right_images_that_do_not_belong_to_the_log_are_refused(log, tmp_path):
    with pytest.raises(InputError, match=r"empty/toy: is not a folder; it should hold the right images"):
        watched(log, right=tmp_path / "empty")
    few = with_right_images(tmp_path / "toy.mcap", tmp_path / "few", frames=3)
    with pytest.raises(InputError, match=r"few/toy: holds 3 PNG files, and .* has 12 frames"):
        watched(log, right=few)
    for number in range(FRAMES):
        (few / "toy" / f"{number:03d}.png").write_bytes(png(np.zeros((64, 64, 3), np.uint8)))
    with pytest.raises(InputError, match=r"000\.png: is 64 x 64 px, and the left image 256 x 128 px"):
        watched(log, right=few)


def test_logs_without_what_the_chain_needs_are_named(tmp_path):
    plain = street(1, frames=2).recording("toy")

    def without(**changes):
        for moment in plain.moments():
            yield replace(moment, cameras={"front": replace(moment.cameras["front"], **changes)})

    path = tmp_path / "toy.mcap"
    write_log(replace(plain, moments=lambda: without(label_png=None)), path)
    with pytest.raises(LogError, match=rf"{path}: frame at \d+ ns: has no label image"):
        watched(path)
    write_log(replace(plain, moments=lambda: (replace(each, motion=()) for each in plain.moments())), path)
    with pytest.raises(LogError, match=rf"{path}: has no motion samples"):
        watched(path)


def test_the_camera_with_disparity_is_taken_and_named_where_there_are_several(tmp_path):
    street_alone = street(1, frames=FRAMES).recording("toy")
    two = dict.fromkeys(("front", "rear"), street_alone.calibrations["front"])

    def doubled():
        for moment in street_alone.moments():
            yield replace(moment, cameras=dict.fromkeys(two, moment.cameras["front"]))

    path = tmp_path / "toy.mcap"
    both = replace(street_alone, calibrations=two, moments=doubled)
    write_log(both, path)
    with pytest.raises(LogError, match="there are several, name one: front, rear"):
        watched(path)
    assert len(watched(path, camera="rear")[0]) == WHOLE
    assert [each.name for each in models_for(("table",), path, CPU, "rear")] == ["table"]
    write_log(single(both, "rear"), path)
    assert len(watched(path)[0]) == WHOLE
    with pytest.raises(LogError, match="camera rear: has no disparity"):
        watched(path, camera="rear")
    write_log(single(single(both, "rear"), "front"), path)
    with pytest.raises(LogError, match=r"camera front, rear: have no disparity.*\{camera: \[front, rear\]\}"):
        watched(path)


def test_models_have_weights_or_get_some(log):
    made = {each.name: each for each in models_for(("residual-town", "ed", "table", "fuse", "ed"), log, CPU)}
    assert list(made) == ["residual-town", "ed", "table", "fuse"]
    assert [name for name, each in made.items() if each.is_random] == ["ed"]
    assert made["table"].model._probability.sum() > 0  # it has counted


def test_models_that_know_the_truth_or_do_not_exist_are_refused(log):
    with pytest.raises(InputError, match="model ceiling: is told the truth, which no vehicle has"):
        models_for(("ceiling",), log, CPU)
    with pytest.raises(InputError, match=r"model: 'fues' is not one of .*did you mean fuse"):
        models_for(("fues",), log, CPU)


def test_a_profile_says_where_it_comes_from(log):
    measured = watched(log)[1]
    profile = profile_of(measured, CPU, "semgrid-eval latency logs")
    assert profile.frames == WHOLE
    assert profile.chain_ms("mine").tolist() == [4.0] * WHOLE
    assert profile.made_by.command == "semgrid-eval latency logs"
    assert {"processor", "cores", "threads", "device"} <= profile.made_by.machine.keys()
