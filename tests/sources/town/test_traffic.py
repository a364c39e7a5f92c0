from dataclasses import replace

import numpy as np
import pytest
from support.traffic import STEP_S, steady_traffic

from semgrid_eval.sources.town.traffic import ROAD_USERS, Traffic, type_index

BUS, PERSON = type_index("bus"), type_index("person")


def test_everybody_is_interpolated_and_centred():
    traffic = steady_traffic([BUS, PERSON], [(0.0, 5.0), (10.0, 0.0)], [8.0, 1.5])
    now = traffic.at(60.0 + 2.5 * STEP_S)
    half_m = ROAD_USERS[BUS].length_m / 2
    np.testing.assert_allclose(now.centre_m[0], (8.0 * 2.5 * STEP_S - half_m, 5.0), atol=1e-4)
    np.testing.assert_allclose(now.centre_m[1], (10.0 + 1.5 * 2.5 * STEP_S, 0.0), atol=1e-4)
    np.testing.assert_allclose(now.velocity_mps, [(8.0, 0.0), (1.5, 0.0)], atol=1e-3)
    assert now.type_index.tolist() == [BUS, PERSON]


def test_turning_takes_the_short_way_round():
    traffic = steady_traffic([BUS], [(0.0, 0.0)], [0.0], steps=3)
    turned = replace(traffic, heading_rad=np.float32([3.1, -3.1, -3.0]))
    assert abs(turned.at(60.0 + STEP_S / 2).yaw_rad[0]) == pytest.approx(np.pi, abs=0.01)


def test_who_jumps_stays_until_the_next_step_and_has_no_velocity():
    traffic = steady_traffic([PERSON], [(0.0, 0.0)], [0.0], steps=4)
    jump = traffic.position_m.copy()
    jump[2:, 0] = 14.0
    found = replace(traffic, position_m=jump).at(60.0 + 1.9 * STEP_S)
    assert found.centre_m[0, 0] == pytest.approx(0.0)
    assert found.velocity_mps[0, 0] == 0.0


def test_only_who_is_there_before_and_after_is_there():
    traffic = steady_traffic([BUS, PERSON], [(0.0, 0.0), (5.0, 0.0)], [0.0, 0.0], steps=3)
    keep = np.array([True, True, True, False, True, True])
    gone = replace(
        traffic,
        offsets=np.array([0, 2, 3, 5]),
        **{name: getattr(traffic, name)[keep] for name in ("actor", "position_m", "heading_rad", "speed_mps")},
    )
    assert gone.at(60.0 + 0.5 * STEP_S).actor.tolist() == [0]
    positions, headings = gone.track(1, 0, 3)
    assert np.isnan(positions[:, 0]).tolist() == [False, True, False]
    assert np.isnan(headings).tolist() == [False, True, False]


def test_traffic_survives_saving(tmp_path):
    traffic = steady_traffic([BUS], [(0.0, 0.0)], [3.0], steps=5)
    traffic.save(tmp_path)
    np.testing.assert_array_equal(Traffic.load(tmp_path).at(60.1).centre_m, traffic.at(60.1).centre_m)
