"""Errors that vary: what is drawn, from where, that it has its effect, and that nothing else changes with it."""

import io
import math
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.towns import SMALL, small_plans, town_cache

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.progress import silent
from semgrid_eval.recording.types import Pose, Quantity
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.drives import Drive
from semgrid_eval.sources.town.noise import DisparityNoise, LabelNoise
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording
from semgrid_eval.sources.town.stage import in_sight
from semgrid_eval.sources.town.traffic import Snapshot
from semgrid_eval.sources.town.varied import RANGES, Range, draw_conditions, fixed_conditions

PARTS = ("disparity", "label", "motion")
ASKED = (512, 256)
# Width and height in pixels, focal length in pixels, baseline, height and pitch of the camera.
CITYSCAPES = (2048, 1024, 2262.0, 0.209, 1.22, 0.038)
KITTI = (1242, 375, 721.5, 0.54, 1.65, 0.0)


@pytest.fixture(scope="module")
def drawn():
    return [draw_conditions(*ASKED, np.random.default_rng(seed)) for seed in range(300)]


@pytest.fixture(scope="module")
def plans():
    return small_plans(errors="varied")


def moments(plan, count=1):
    iterator = iter(render_recording(plan).moments())
    return [next(iterator) for _ in range(count)]


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)))


def test_logs_that_do_not_vary_are_what_they_were():
    drive = Drive(7, 61.5)
    name, seed = "town00_000000_000000", (3, 0, 2, 0)
    plan = RecordingPlan(name, "train", Path("towns/a"), "0" * 16, drive, seed, 128, 64, "modelled")
    assert plan.digest == "4c5615b6b625683a"
    assert plan.conditions == fixed_conditions(128, 64)
    assert "drawn" not in plan.description()


@pytest.mark.parametrize("part", PARTS)
def test_every_strength_is_drawn_over_its_whole_range_and_on_both_sides_of_the_usual_one(drawn, part):
    usual = getattr(fixed_conditions(*ASKED), part)
    for name, bounds in RANGES[part].items():
        found = [getattr(getattr(each, part), name) for each in drawn]
        assert bounds.low <= min(found) < max(found) <= bounds.high
        assert bounds.low < getattr(usual, name) < bounds.high, name
        if bounds.by_ratio:
            shares = [math.log(value / bounds.low) / math.log(bounds.high / bounds.low) for value in found]
            assert np.quantile(shares, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.1)


def test_what_is_not_drawn_keeps_its_usual_value(drawn):
    for noise, part in ((DisparityNoise(), "disparity"), (LabelNoise(), "label")):
        for name in {field.name for field in fields(noise)} - RANGES[part].keys():
            assert {getattr(getattr(each, part), name) for each in drawn} == {getattr(noise, name)}


def test_cameras_have_square_pixels_and_the_optics_that_were_drawn(drawn):
    ranges = RANGES["camera"]
    for each in drawn:
        camera = each.calibration
        assert camera.fx_px == camera.fy_px
        assert ranges["focal_widths"].low <= camera.fx_px / each.width_px <= ranges["focal_widths"].high
        assert camera.fx_px / each.height_px == pytest.approx(2.1, abs=0.32)
        depth_disparity = camera.fx_px * camera.baseline_m / each.width_px
        assert 0.2 - 1e-6 <= depth_disparity <= 0.36 + 1e-6
        assert 0.59 < each.width_px * each.height_px / (512 * 256) < 1.81
        assert ranges["z_m"].low <= camera.z_m <= ranges["z_m"].high
        assert ranges["pitch_rad"].low <= camera.pitch_rad <= ranges["pitch_rad"].high
        assert 0.4 < (camera.u0_px + 0.5) / each.width_px < 0.6
        assert 0.4 < (camera.v0_px + 0.5) / each.height_px < 0.6
    assert len({(each.width_px, each.height_px) for each in drawn}) > 250


@pytest.mark.parametrize("rig", [CITYSCAPES, KITTI])
def test_the_ranges_hold_the_cameras_that_they_are_to_span(rig):
    width, height, focal_px, baseline_m, z_m, pitch_rad = rig
    ranges = RANGES["camera"]
    placed = {
        "focal_widths": focal_px / width,
        "focal_heights": focal_px / height,
        "depth_disparity": focal_px * baseline_m / width,
        "z_m": z_m,
        "pitch_rad": pitch_rad,
    }
    for name, value in placed.items():
        assert ranges[name].low < value < ranges[name].high, name


def test_a_range_is_even_in_the_number_or_in_its_logarithm():
    rng = np.random.default_rng(0)
    evenly = [Range(-1.0, 3.0, "m", by_ratio=False).draw(rng) for _ in range(2000)]
    by_ratio = [Range(0.01, 1.0, "m").draw(rng) for _ in range(2000)]
    assert np.median(evenly) == pytest.approx(1.0, abs=0.15)
    assert np.median(by_ratio) == pytest.approx(0.1, rel=0.25)
    assert all(value == round(value, 6) for value in evenly + by_ratio)


def test_plans_differ_from_each_other_and_not_by_worker(plans):
    assert len({plan.drawn for plan in plans}) == len(plans)
    config = SyntheticConfig(**SMALL, width=128, height=64, errors="varied")
    assert plan_recordings(config, town_cache(), silent, workers=2) == plans
    assert {plan.digest for plan in plans}.isdisjoint(plan.digest for plan in small_plans())
    assert all((plan.width_px, plan.height_px) == (plan.drawn.width_px, plan.drawn.height_px) for plan in plans)


def test_the_same_command_gives_the_same_bytes(plans):
    assert moments(plans[0], 2) == moments(small_plans(errors="varied")[0], 2)


def test_traffic_and_ways_are_those_of_the_recordings_that_do_not_vary(plans):
    for varied, fixed in zip(moments(plans[1], 3), moments(small_plans()[1], 3), strict=True):
        assert (varied.stamp_ns, varied.pose, varied.actors) == (fixed.stamp_ns, fixed.pose, fixed.actors)
        assert varied.motion != fixed.motion
        assert varied.cameras["front"].label_png != fixed.cameras["front"].label_png


def test_points_of_road_lie_on_the_ground_whatever_the_camera():
    for plan in small_plans(errors="varied", stereo="exact"):
        recording, frame = render_recording(plan), moments(plan)[0].cameras["front"]
        camera = recording.calibrations["front"]
        disparity, label = (pixels(frame.disparity_png).astype(float) - 1) / 256, pixels(frame.label_png)
        assert disparity.shape == label.shape == (plan.height_px, plan.width_px)
        v, u = np.nonzero((label == LABEL_ID["road"]) & (disparity > 2.0))
        assert len(u) > 200
        depth_m = camera.fx_px * camera.baseline_m / disparity[v, u]
        optical_m = [(u - camera.u0_px) / camera.fx_px * depth_m, (v - camera.v0_px) / camera.fy_px * depth_m, depth_m]
        assert np.abs(camera.ego_from_optical.apply(np.stack(optical_m, axis=1))[:, 2]).max() < 0.03


def changed(part, **strengths):
    """The first recording with one part of the usual errors changed."""
    plan, usual = small_plans()[0], fixed_conditions(128, 64)
    return replace(plan, drawn=replace(usual, **{part: replace(getattr(usual, part), **strengths)}))


def test_strengths_reach_the_pictures_and_the_reports():
    exact = pixels(moments(small_plans()[0])[0].cameras["front"].exact_label_png)
    frames = {
        part: moments(changed(part, **strength), 2)
        for part, strength in {
            "disparity": {"dropout": 0.9, "far_dropout": 0.9},
            "label": {"mistaken": 3.0},
            "motion": {"yaw_rate_bias_radps": 1.0},
        }.items()
    }
    usual = moments(small_plans()[0], 2)
    first = {part: each[0].cameras["front"] for part, each in frames.items()} | {"usual": usual[0].cameras["front"]}
    density = {part: (pixels(frame.disparity_png) > 0).mean() for part, frame in first.items()}
    wrong = {part: (pixels(frame.label_png) != exact).mean() for part, frame in first.items()}
    assert density["disparity"] < 0.5 * density["usual"]
    assert wrong["label"] > 2 * wrong["usual"]
    assert abs(frames["motion"][0].motion[0].yaw_rate_radps - usual[0].motion[0].yaw_rate_radps) > 0.01
    assert (density["label"], wrong["disparity"]) == (density["usual"], wrong["usual"])


def test_the_wider_side_of_a_camera_counts():
    conditions = fixed_conditions(512, 256)
    assert conditions.side_slope == pytest.approx(1096.5 / 2262)
    wide = replace(conditions, calibration=replace(conditions.calibration, fx_px=300.0, u0_px=199.5))
    assert wide.side_slope == pytest.approx(312 / 300)


def test_who_stands_aside_is_on_stage_for_a_wide_camera_alone():
    # Of four, one is ahead, two are 20 m ahead and 23 m to either side, and one is that far behind.
    place_m = np.array([[20.0, 0.0], [20.0, 23.0], [20.0, -23.0], [-20.0, 0.0]])
    ids = np.arange(4)
    actors = Snapshot(actor=ids, type_index=ids * 0, centre_m=place_m, yaw_rad=ids * 0.0, velocity_mps=place_m * 0)
    ahead, turned = Pose(0, 0.0, 0.0, 0.0), Pose(0, 0.0, 0.0, math.pi)
    assert in_sight(actors, ahead, 0.55).actor.tolist() == [0]
    assert in_sight(actors, ahead, 0.9).actor.tolist() == [0, 1, 2]
    assert in_sight(actors, turned, 0.9).actor.tolist() == [3]


@pytest.mark.parametrize(("stereo", "parts"), [("modelled", PARTS), ("matched", ("label", "motion")), ("exact", ())])
def test_the_log_says_what_was_drawn_and_has_a_part_in_it(tmp_path, stereo, parts):
    plan = small_plans(errors="varied", stereo=stereo)[0]
    recording = replace(render_recording(plan), moments=lambda: iter(moments(plan)))
    write_log(recording, tmp_path / "a.mcap")
    with LogReader(tmp_path / "a.mcap") as log:
        found, camera = log.conditions(), log.calibration("front")
    assert found["camera.width_px"] == Quantity(plan.width_px, "px")
    assert found["camera.baseline_m"] == Quantity(camera.baseline_m, "m")
    assert {name.partition(".")[0] for name in found} == {"camera", *parts}
    for part in parts:
        strengths = {name.partition(".")[2]: value for name, value in found.items() if name.startswith(f"{part}.")}
        assert strengths.keys() == RANGES[part].keys()
        assert all(strengths[name].value == asdict(getattr(plan.drawn, part))[name] for name in strengths)
        assert all(strengths[name].unit == RANGES[part][name].unit for name in strengths)
    assert read_recording(tmp_path / "a.mcap").conditions == found
