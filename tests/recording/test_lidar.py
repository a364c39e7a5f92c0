import math

import numpy as np
import pytest
from support.swept import TURNED, sweep

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3
from semgrid_eval.recording.lidar import MAX_POINTS, LidarSweep, Mount


@pytest.mark.parametrize(
    ("point", "line"),
    [
        ((1.0, math.nan, 0.0), "point 1, (1, nan, 0) m, is not within 1000 m of the LiDAR"),
        ((math.inf, 0.0, 0.0), "point 1, (inf, 0, 0) m, is not within 1000 m of the LiDAR"),
        ((0.0, 0.0, -1001.0), "point 1, (0, 0, -1001) m, is not within 1000 m of the LiDAR"),
    ],
)
def test_points_that_cannot_be_are_refused(point, line):
    with pytest.raises(InputError) as raised:
        sweep(0, [(1.0, 2.0, 3.0), point])
    assert str(raised.value) == line


def test_labels_of_another_count_than_points_are_refused():
    with pytest.raises(InputError, match=r"^has 1 label for 2 points$"):
        sweep(0, [(1.0, 2.0, 3.0)] * 2, ["car"])
    points_m = np.zeros((1, 3), np.float32)
    with pytest.raises(InputError, match=r"^has 2 intensities for 1 point$"):
        LidarSweep(0, TURNED, points_m, np.zeros(2, np.float32), None)


def test_a_sweep_has_a_bound():
    many = np.zeros((MAX_POINTS + 1, 3), np.float32)
    with pytest.raises(InputError, match=f"^has {MAX_POINTS + 1} points; at most {MAX_POINTS} are allowed$"):
        LidarSweep(0, TURNED, many, many[:, 0], None)


def test_a_mount_is_the_transform_that_it_was_made_of():
    turned = SE3.from_roll_pitch_yaw(0.1, -0.2, 2.5, (1.0, 2.0, 3.0))
    found = Mount.of(turned).ego_from_sensor
    np.testing.assert_allclose(found.rotation, turned.rotation, atol=1e-15)
    np.testing.assert_array_equal(found.translation_m, turned.translation_m)
