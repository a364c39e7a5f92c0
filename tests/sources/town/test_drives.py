from dataclasses import replace

import numpy as np
import pytest
from support.traffic import steady_traffic

from semgrid_eval.errors import InputError
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.sources.town.drives import FRAME_RATE_HZ, choose_drives, ego_path
from semgrid_eval.sources.town.traffic import type_index

CAR, BUS, PERSON = type_index("car_family"), type_index("bus"), type_index("person")


def cars(speeds_mps, **changes):
    count = len(speeds_mps)
    lanes = [(0.0, 10.0 * index) for index in range(count)]
    return steady_traffic(changes.get("types", [CAR] * count), changes.get("starts_m", lanes), list(speeds_mps))


def test_a_third_stands_and_the_rest_has_the_speeds_of_a_town():
    traffic = cars(np.repeat(np.arange(0.0, 14.1, 0.25), 6))
    chosen = choose_drives(traffic, 240, np.random.default_rng(0))
    speeds = np.array([traffic.speed_mps[drive.actor] for drive in chosen])
    assert (speeds < 2.0).mean() == pytest.approx(1 / 3, abs=0.05)
    moving = speeds[speeds >= 2.0]
    assert 6.0 < np.median(moving) < 8.0
    assert (moving > 11.0).mean() < 0.15


def test_windows_of_one_car_do_not_overlap_and_lie_inside_its_track():
    traffic = cars([0.0, 3.0, 5.0, 7.0, 9.0])
    chosen = choose_drives(traffic, 12, np.random.default_rng(1))
    for actor in range(5):
        starts = sorted(drive.start_s for drive in chosen if drive.actor == actor)
        assert (np.diff(starts) > FRAME_COUNT / FRAME_RATE_HZ).all()
    for drive in chosen:
        path = ego_path(traffic, drive)
        assert path.times_s[0] < drive.start_s
        assert path.times_s[-1] > drive.start_s + FRAME_COUNT / FRAME_RATE_HZ


def test_long_windows_are_inside_the_track_apart_and_looked_at_all_the_way():
    frames = 120
    traffic = cars([0.0, 3.0, 5.0, 7.0, 9.0])
    chosen = choose_drives(traffic, 8, np.random.default_rng(1), frames)
    assert {drive.frames for drive in chosen} == {frames}
    for actor in range(5):
        starts = sorted(drive.start_s for drive in chosen if drive.actor == actor)
        assert (np.diff(starts) > frames / FRAME_RATE_HZ).all()
    for drive in chosen:
        assert ego_path(traffic, drive).times_s[-1] > drive.start_s + frames / FRAME_RATE_HZ
    # Somebody stands 50 m ahead, where a car of 9 m/s comes after a drive of 30 frames has ended.
    inside = cars([9.0, 0.0], types=[CAR, PERSON], starts_m=[(0.0, 0.0), (70.0, 0.2)])
    free = choose_drives(inside, 1, np.random.default_rng(0))[0]
    assert not free.start_s < inside.times_s[0] + 7.0 < free.start_s + 1.0
    with pytest.raises(InputError, match="holds only 0 of 1 windows of 330 frames"):
        choose_drives(inside, 1, np.random.default_rng(0), 330)


def test_only_cars_carry_the_camera():
    traffic = cars([5.0, 5.0, 1.0], types=[BUS, CAR, PERSON])
    assert {drive.actor for drive in choose_drives(traffic, 3, np.random.default_rng(0))} == {1}


def test_nobody_may_stand_inside_the_ego_vehicle():
    inside = cars([5.0, 5.0], types=[CAR, PERSON], starts_m=[(0.0, 0.0), (-1.5, 0.2)])
    with pytest.raises(InputError, match="holds only 0 of 1 windows"):
        choose_drives(inside, 1, np.random.default_rng(0))
    beside = cars([5.0, 5.0], types=[CAR, PERSON], starts_m=[(0.0, 0.0), (-1.5, 1.6)])
    assert len(choose_drives(beside, 1, np.random.default_rng(0))) == 1


def test_a_track_that_turns_too_fast_is_not_driven():
    traffic = cars([6.0])
    sideways = traffic.position_m.copy()
    sideways[:, 1] = 3.0 * np.sin(np.arange(len(sideways)) * 0.1)  # headings swing by 0.7 rad, 1.7 rad a second
    traffic = replace(traffic, position_m=sideways)
    with pytest.raises(InputError, match="0 of 1"):
        choose_drives(traffic, 1, np.random.default_rng(0))


def test_the_choice_depends_on_the_generator_alone():
    traffic = cars(np.arange(0.0, 12.0))
    assert choose_drives(traffic, 10, np.random.default_rng(5)) == choose_drives(traffic, 10, np.random.default_rng(5))
    assert choose_drives(traffic, 10, np.random.default_rng(5)) != choose_drives(traffic, 10, np.random.default_rng(6))
