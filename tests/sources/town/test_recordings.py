"""Recordings of a small simulated town: their form, their truth, and that equal seeds give equal bytes."""

import io
import math
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from support.towns import SMALL, small_plans, town_cache

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError, MissingExtraError
from semgrid_eval.labels import CITYSCAPES_LABELS, LABEL_ID
from semgrid_eval.progress import silent
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import render_recording
from semgrid_eval.sources.town.town import FIRST_PARKED_ID, TownSpec, prepare_town

PICTURES = ("image_file", "disparity_png", "label_png", "exact_label_png", "exact_disparity_png", "instance_png")


@pytest.fixture(scope="module")
def plans():
    return small_plans()


@pytest.fixture(scope="module")
def moments(plans):
    return list(render_recording(plans[0]).moments())


@pytest.fixture(scope="module")
def exact_moments():
    return list(render_recording(small_plans(stereo="exact")[0]).moments())


def test_recordings_of_a_town_are_a_group(plans):
    groups = [render_recording(plan).group for plan in plans]
    assert groups == ["town00", "town00", "town00", "town01"]
    assert all("group" not in plan.description() for plan in plans)  # logs that were made before stay up to date


def pixels(png: bytes):
    return np.asarray(Image.open(io.BytesIO(png)))


def front(moment):
    return moment.cameras["front"]


def test_splits_have_towns_of_their_own(plans):
    assert [plan.split for plan in plans] == ["train"] * 3 + ["val"]
    towns = {split: {plan.town for plan in plans if plan.split == split} for split in ("train", "val")}
    assert not towns["train"] & towns["val"]
    assert len({plan.name for plan in plans}) == 4
    assert plans[3].name == "town01_000003_000000"


def test_a_recording_is_thirty_frames_on_an_irregular_clock(moments):
    stamps = np.array([moment.stamp_ns for moment in moments])
    gaps_s = np.diff(stamps) * 1e-9
    assert len(moments) == 30
    assert (gaps_s > 0.05).all()
    assert gaps_s.mean() == pytest.approx(1 / 17, abs=0.001)
    assert 0.0003 < gaps_s.std() < 0.004
    assert all(moment.motion[0].stamp_ns == moment.stamp_ns == front(moment).stamp_ns for moment in moments)


def test_pictures_have_their_sizes_depths_and_labels(moments):
    depths = {"image_file": "RGB", "disparity_png": "I;16", "label_png": "L", "exact_label_png": "L"}
    depths |= {"exact_disparity_png": "I;16", "instance_png": "I;16"}
    for name in PICTURES:
        picture = Image.open(io.BytesIO(getattr(front(moments[0]), name)))
        assert picture.size == (128, 64), name
        assert picture.mode == depths[name], name
    known = {label.label_id for label in CITYSCAPES_LABELS}
    for name in ("label_png", "exact_label_png"):
        assert set(np.unique(pixels(getattr(front(moments[0]), name)))) <= known


def test_modelled_errors_are_small_and_exact_ones_none(moments, exact_moments):
    wrong = [(pixels(front(m).label_png) != pixels(front(m).exact_label_png)).mean() for m in moments]
    assert 0.001 < np.mean(wrong) < 0.06
    for moment in exact_moments[::10]:
        assert front(moment).label_png == front(moment).exact_label_png
        assert front(moment).disparity_png == front(moment).exact_disparity_png


def test_disparity_is_lost_in_places_and_near_the_truth_elsewhere(moments):
    exact = np.stack([pixels(front(m).exact_disparity_png) for m in moments]).astype(float)
    found = np.stack([pixels(front(m).disparity_png) for m in moments]).astype(float)
    solid = exact > 0
    assert 0.70 < (found[solid] > 0).mean() < 0.97
    both = solid & (found > 0)
    error_px = np.abs(found - exact)[both] / 256 * 2048 / 128
    assert 0.2 < np.median(error_px) / 0.6745 < 1.0


def test_points_of_road_lie_on_the_ground(exact_moments, plans):
    calibration = render_recording(plans[0]).calibrations["front"]
    frame = front(exact_moments[0])
    disparity = (pixels(frame.disparity_png).astype(float) - 1) / 256
    v, u = np.nonzero((pixels(frame.label_png) == LABEL_ID["road"]) & (disparity > 2.0))
    depth_m = calibration.fx_px * calibration.baseline_m / disparity[v, u]
    down_m = (v - calibration.v0_px) / calibration.fy_px * depth_m
    assert len(u) > 200
    pitch = calibration.pitch_rad  # yaw and roll are too small to matter here
    height_m = calibration.z_m - math.cos(pitch) * down_m - math.sin(pitch) * depth_m
    assert np.abs(height_m).max() < 0.02


def test_instances_are_actors_of_the_same_class(exact_moments):
    riding = {LABEL_ID["rider"]: LABEL_ID["bicycle"]}
    for moment in exact_moments[::10]:
        actors = {actor.actor_id: actor for actor in moment.actors}
        label, instance = pixels(front(moment).exact_label_png), pixels(front(moment).instance_png)
        for actor_id in np.unique(instance[instance > 0]):
            labels = {riding.get(int(value), int(value)) for value in np.unique(label[instance == actor_id])}
            assert labels == {actors[actor_id].label_id}


def test_the_pixels_of_an_actor_lie_in_its_box(exact_moments, plans):
    calibration = render_recording(plans[0]).calibrations["front"]
    checked = 0
    for moment in exact_moments[::10]:
        instance = pixels(front(moment).instance_png)
        disparity = (pixels(front(moment).disparity_png).astype(float) - 1) / 256
        for actor in moment.actors:
            v, u = np.nonzero((instance == actor.actor_id) & (disparity > 3.0))
            if len(u) < 10:
                continue
            checked += 1
            ahead_m = calibration.fx_px * calibration.baseline_m / disparity[v, u] + calibration.x_m
            left_m = calibration.y_m - (u - calibration.u0_px) / calibration.fx_px * (ahead_m - calibration.x_m)
            c, s = math.cos(moment.pose.yaw_rad), math.sin(moment.pose.yaw_rad)
            x = moment.pose.x_m + c * ahead_m - s * left_m - actor.x_m
            y = moment.pose.y_m + s * ahead_m + c * left_m - actor.y_m
            along = x * math.cos(actor.yaw_rad) + y * math.sin(actor.yaw_rad)
            across = -x * math.sin(actor.yaw_rad) + y * math.cos(actor.yaw_rad)
            assert np.abs(along).max() < actor.length_m / 2 + 0.6
            assert np.abs(across).max() < actor.width_m / 2 + 0.6
    assert checked >= 3


def test_velocities_of_actors_are_their_displacements(moments):
    first, later = ({a.actor_id: a for a in moments[k].actors} for k in (10, 12))
    seconds = (moments[12].stamp_ns - moments[10].stamp_ns) * 1e-9
    for actor_id in first.keys() & later.keys():
        before, after = first[actor_id], later[actor_id]
        moved = np.array([after.x_m - before.x_m, after.y_m - before.y_m]) / seconds
        mean = (
            np.array([before.velocity_x_mps + after.velocity_x_mps, before.velocity_y_mps + after.velocity_y_mps]) / 2
        )
        np.testing.assert_allclose(moved, mean, atol=1.2)
        if actor_id >= FIRST_PARKED_ID:
            assert before == after
    assert any(math.hypot(a.velocity_x_mps, a.velocity_y_mps) > 1.0 for a in first.values())


def test_reported_motion_integrates_to_the_pose(exact_moments):
    yaw_rad = exact_moments[0].pose.yaw_rad
    x_m, y_m = exact_moments[0].pose.x_m, exact_moments[0].pose.y_m
    for before, after in pairwise(exact_moments):
        seconds = (after.stamp_ns - before.stamp_ns) * 1e-9
        speed = (before.motion[0].speed_mps + after.motion[0].speed_mps) / 2
        turn = (before.motion[0].yaw_rate_radps + after.motion[0].yaw_rate_radps) / 2 * seconds
        x_m += speed * seconds * math.cos(yaw_rad + turn / 2)
        y_m += speed * seconds * math.sin(yaw_rad + turn / 2)
        yaw_rad += turn
    last = exact_moments[-1].pose
    assert (x_m, y_m) == pytest.approx((last.x_m, last.y_m), abs=0.1)
    assert yaw_rad == pytest.approx(last.yaw_rad, abs=0.01)


def test_the_same_seed_gives_the_same_bytes(plans, moments):
    again = list(render_recording(plans[0]).moments())
    assert again == moments
    assert render_recording(plans[0]).source_digest == plans[0].digest


def test_numbers_are_told_to_a_millionth_on_which_processors_agree(moments):
    for moment in moments[::10]:
        actors = [value for actor in moment.actors for value in (actor.x_m, actor.y_m, actor.yaw_rad, actor.height_m)]
        rates = [moment.motion[0].speed_mps, moment.motion[0].yaw_rate_radps, moment.actors[0].velocity_x_mps]
        for value in (moment.pose.x_m, moment.pose.y_m, moment.pose.yaw_rad, *actors, *rates):
            assert value == round(value, 6)
            assert math.copysign(1.0, value) > 0 or value != 0.0


def test_plans_do_not_depend_on_workers(plans):
    config = SyntheticConfig(**SMALL, width=128, height=64)
    assert plan_recordings(config, town_cache(), silent, workers=2) == plans


def test_a_town_built_anew_has_the_same_bytes(plans, tmp_path):
    spec = TownSpec(0, "centre", SMALL["seed"], SMALL["town_size_m"], SMALL["duration_s"])
    again = prepare_town(spec, tmp_path)
    assert again.name == plans[0].town.name
    files = sorted(path.relative_to(again) for path in again.rglob("*.*"))
    assert len(files) > 12
    assert [file for file in files if (again / file).read_bytes() != (plans[0].town / file).read_bytes()] == []


def test_another_seed_gives_another_town(plans):
    spec = TownSpec(0, "centre", SMALL["seed"] + 1, SMALL["town_size_m"], SMALL["duration_s"])
    assert not plans[0].town.name.endswith(spec.digest())


def test_more_windows_than_the_traffic_holds_are_refused_with_what_to_do():
    with pytest.raises(InputError, match=r"holds only \d+ of 99999 windows of 30 frames; ask for fewer"):
        small_plans(recordings=100_000, val_share=1e-5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recordings": 0}, r"recordings: must be at least 1, not 0"),
        ({"recordings": 10**9}, "recordings"),
        ({"width": 100_000}, r"width: .*4096"),
        ({"height": 1}, "height"),
        ({"stereo": "none"}, "stereo"),
        ({"towns": 1}, "different towns"),
        ({"town_size_m": 1e9}, "town_size_m"),
        ({"val_share": 1.0}, "val_share"),
        ({"town_size_m": 2000.0, "duration_s": 3600.0}, r"a town of 2000 m can be simulated for 100 s at most"),
        ({"val_towns": 2}, "val_towns must leave a town for training"),
        ({"val_towns": 1, "val_share": 0.0}, "val_towns must leave .* and val_share recordings"),
        ({"colour": True}, "unknown key"),
    ],
)
def test_absurd_wishes_are_refused_by_name(changes, message):
    with pytest.raises(ConfigError, match=message):
        parse_config(SyntheticConfig, {**SMALL, **changes})


@pytest.mark.slow
def test_validation_may_have_another_share_of_the_towns_than_of_the_recordings():
    config = SyntheticConfig(**{**SMALL, "towns": 3, "recordings": 8}, val_towns=1)
    plans = plan_recordings(config, town_cache(), silent)
    towns = {split: {plan.town for plan in plans if plan.split == split} for split in ("train", "val")}
    assert (len(towns["train"]), len(towns["val"])) == (2, 1)
    assert [plan.split for plan in plans] == ["train"] * 6 + ["val"] * 2


def test_without_embree_the_extra_is_named_before_towns_are_simulated(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"embreex is not installed; .*semgrid-eval\[synthetic\]"):
        plan_recordings(SyntheticConfig(**SMALL), tmp_path, silent)
    assert list(tmp_path.iterdir()) == []


def test_a_town_that_was_removed_is_named(plans, tmp_path):
    with pytest.raises(InputError, match="gone: holds no complete town"):
        next(iter(render_recording(replace(plans[0], town=tmp_path / "gone")).moments()))


def test_matched_disparity_is_near_the_truth_where_it_is_found():
    plan = replace(small_plans()[0], stereo="matched", width_px=512, height_px=256)
    frame = front(next(iter(render_recording(plan).moments())))
    exact, found = (pixels(png).astype(float) for png in (frame.exact_disparity_png, frame.disparity_png))
    assert found.shape == (256, 512)
    both = (exact > 256) & (found > 0)
    assert both.sum() > 0.6 * (exact > 256).sum()
    assert np.median(np.abs(found - exact)[both]) / 256 < 0.5
    assert pixels(frame.label_png).shape == pixels(frame.instance_png).shape == (256, 512)
