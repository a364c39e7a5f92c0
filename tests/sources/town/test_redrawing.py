"""Errors drawn again: the same random numbers give the recording's own frames, others give others like them."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from support.cameras import calibration
from support.towns import small_plans
from support.toy_world import street

from semgrid_eval.errors import LogError, UnknownTruthError
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.disparity import coded_disparity, decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.redrawing import Pictures, redrawing_of
from semgrid_eval.sources.town.noise import DisparityErrors, DisparityNoise
from semgrid_eval.sources.town.picture_errors import (
    PictureErrors,
    Strengths,
    recording_streams,
)
from semgrid_eval.sources.town.redrawing import TownErrors
from semgrid_eval.sources.town.rendering import render_recording
from semgrid_eval.sources.town.sensors import Camera, View
from semgrid_eval.sources.town.stereo_camera import StereoCamera
from semgrid_eval.sources.town.varied import fixed_conditions

SEED = (5, 0, 2, 1)
WIDTH, HEIGHT = 128, 64


def exact_picture(frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Labels and depth of a scene that changes from frame to frame."""
    label = np.full((HEIGHT, WIDTH), LABEL_ID["road"], np.uint8)
    depth_m = np.repeat(np.linspace(60.0, 5.0, HEIGHT, dtype=np.float32)[:, None], WIDTH, axis=1)
    label[: HEIGHT // 3], depth_m[: HEIGHT // 3] = LABEL_ID["sky"], np.inf
    left = 20 + 4 * frame
    label[25:50, left : left + 30], depth_m[25:50, left : left + 30] = LABEL_ID["car"], 9.0 + frame
    return label, depth_m


def view(frame: int) -> View:
    label, depth_m = exact_picture(frame)
    nothing = np.zeros(label.size)
    places = (np.zeros((label.size, 3), np.float32), label.ravel(), nothing.astype(np.uint16))
    return View(depth_m.ravel(), *places, nothing.astype(np.uint8), nothing.astype(np.int32))


def test_a_branch_that_goes_on_by_the_same_random_numbers_is_the_recording_byte_for_byte():
    camera = Camera(calibration(), WIDTH, HEIGHT)
    conditions = replace(fixed_conditions(WIDTH, HEIGHT), calibration=calibration())
    stereo = StereoCamera(conditions, "modelled", recording_streams(SEED)[-1])
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    own = [stereo.frame(frame, [(view(frame), image)]) for frame in range(7)]

    numbers = recording_streams(SEED)[-1].spawn(2)
    errors = PictureErrors.begin("modelled", Strengths(), *numbers)
    blank = np.zeros((HEIGHT, WIDTH), np.uint8)
    for _ in range(4):  # whatever the pictures show
        errors.add(blank, blank.astype(np.float32))
    branch = errors.branched(*deepcopy(numbers))
    errors.branched(*np.random.default_rng(1).spawn(2)).add(
        blank, blank.astype(np.float32)
    )  # another one changes nothing
    for frame in range(4, 7):
        label, depth_m = exact_picture(frame)
        measured, measured_px = branch.add(label, camera.disparity_px(depth_m))
        assert np.array_equal(measured, decode_gray(own[frame].label_png, bit_depth=8))
        assert np.array_equal(coded_disparity(measured_px), decode_gray(own[frame].disparity_png, bit_depth=16))
        assert (measured != label).any()


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("town") / "town.mcap"
    write_log(render_recording(small_plans()[0]), path)
    return path


def exact(frame) -> Pictures:
    disparity = decode_gray(frame.exact_disparity_png, bit_depth=16)
    return Pictures(decode_gray(frame.exact_label_png, bit_depth=8), disparity)


def test_a_log_tells_its_own_errors_up_to_the_rounding_of_its_exact_disparity(log):
    with LogReader(log) as reader:
        errors, frames = redrawing_of(reader, "front"), list(reader.frames("front"))
    for number in (0, 4, 11):
        pictures = exact(frames[number])
        state = errors.after(number - 1, pictures)
        label, disparity_px = deepcopy(state).add(pictures.label, decoded_disparity(pictures.disparity))
        assert np.array_equal(label, decode_gray(frames[number].label_png, bit_depth=8))
        off = np.abs(
            coded_disparity(disparity_px).astype(int) - decode_gray(frames[number].disparity_png, bit_depth=16)
        )
        assert (off > 1).mean() < 1e-3
        assert (off == 0).mean() > 0.5


def test_draws_are_the_same_again_in_whatever_order_and_number_and_each_is_another():
    pictures = Pictures(exact_picture(3)[0], np.full((HEIGHT, WIDTH), 2000, np.uint16))
    first = TownErrors(SEED, "modelled")
    late = [list(first.continued(pictures, newest, 6, 3)) for newest in (2, 5)]
    again = TownErrors(SEED, "modelled")
    early = [list(again.continued(pictures, newest, 6, 5))[:3] for newest in (5, 2)][::-1]
    for one, other in zip(late, early, strict=True):
        assert all(np.array_equal(a.disparity, b.disparity) for a, b in zip(one, other, strict=True))
        assert all(np.array_equal(a.label, b.label) for a, b in zip(one, other, strict=True))
    drawn = [*late[0], *late[1], *first.fresh(pictures, 6, 3)]
    assert len({each.disparity.tobytes() for each in drawn}) == len(drawn)


def test_several_frames_at_once_keep_as_much_of_an_error_as_one_after_the_other():
    noise = DisparityNoise(0.0, 1.0, 0.0, mismatched=0.0, dropout=0.0, far_dropout=0.0, speckle=0.0, fattened=0.0)
    plane = np.full((128, 256), 8.0, np.float32)

    def kept(step):
        found = []
        for seed in range(6):
            errors = DisparityErrors(noise, np.random.default_rng(seed))
            before = errors.add(plane) - 8.0
            for _ in range(5 // step):
                after = errors.add(plane, step) - 8.0
            found.append((np.corrcoef(before.ravel(), after.ravel())[0, 1], after.std() / before.std()))
        return np.mean(found, axis=0)

    for step in (1, 5):
        assert kept(step) == pytest.approx([0.9**5, 1.0], abs=0.08)


def test_continued_draws_are_nearer_to_the_recording_than_fresh_ones(log):
    with LogReader(log) as reader:
        errors, frames = redrawing_of(reader, "front"), list(reader.frames("front"))
    pictures, own = exact(frames[6]), decode_gray(frames[6].disparity_png, bit_depth=16).astype(float)

    def off(drawn):
        mean = np.mean([each.disparity.astype(float) for each in drawn], axis=0)
        return np.abs(mean - own)[(own > 0) & (mean > 1)].mean()

    assert off(errors.continued(pictures, 5, 6, 8)) < off(errors.fresh(pictures, 6, 8))


def test_exact_pictures_have_no_errors_to_draw():
    pictures = Pictures(exact_picture(0)[0], np.full((HEIGHT, WIDTH), 2000, np.uint16))
    for drawn in TownErrors(SEED, "exact").continued(pictures, 1, 3, 2):
        assert np.array_equal(drawn.label, pictures.label)
        assert np.array_equal(drawn.disparity, pictures.disparity)


def test_logs_that_cannot_be_drawn_again_say_why(tmp_path):
    toy = tmp_path / "toy.mcap"
    write_log(street(frames=2).recording(), toy)
    with LogReader(toy) as reader, pytest.raises(UnknownTruthError, match="holds no exact pictures whose errors"):
        redrawing_of(reader, "front")
    plan = small_plans()[0]
    cases = {
        "matched": ({"stereo": "matched"}, UnknownTruthError, "comes from matching"),
        "other": ({"stereo": "modelled"}, UnknownTruthError, "not what this version renders"),
        "broken": ({}, LogError, "not the plan of a recording"),
    }
    for name, (change, error, message) in cases.items():
        path = tmp_path / f"{name}.mcap"
        recording = street(frames=2).recording()
        described = plan.description() | change if change else [1]
        digest = replace(plan, **change).digest if name == "matched" else "0"
        files = {"plan.json": json.dumps(described).encode()}
        write_log(replace(recording, source_files=files, source_digest=digest), path)
        with LogReader(path) as reader, pytest.raises(error, match=message):
            redrawing_of(reader, "front")
