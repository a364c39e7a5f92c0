from dataclasses import replace

import numpy as np
import pytest
from support.driving import CALIBRATION, START_NS

from semgrid_eval.errors import InputError
from semgrid_eval.log import calibrations


def test_camera_matrix_is_what_viewers_expect():
    known, rest = calibrations.calibration_messages(START_NS, "front", CALIBRATION, (64, 32))
    assert (known.width, known.height) == (64, 32)
    assert list(known.K) == [70.5, 0, 31.5, 0, 70.25, 15.75, 0, 0, 1]
    assert np.reshape(known.P, (3, 4))[:, :3].tolist() == np.reshape(known.K, (3, 3)).tolist()
    assert calibrations.read_calibration(known.SerializeToString(), rest.SerializeToString()) == CALIBRATION


def test_a_single_camera_has_no_baseline_before_and_after():
    calibration = replace(CALIBRATION, baseline_m=None)
    known, rest = calibrations.calibration_messages(START_NS, "left", calibration, (64, 32))
    assert rest.baseline_m == 0.0
    assert calibrations.read_calibration(known.SerializeToString(), rest.SerializeToString()) == calibration
    assert calibrations.read_size(known.SerializeToString()) == (64, 32)


def test_incomplete_or_impossible_calibration_is_refused():
    known, rest = calibrations.calibration_messages(START_NS, "front", CALIBRATION, (64, 32))
    rest.baseline_m = -0.1
    with pytest.raises(InputError, match=r"baseline_m: -0\.1 is not positive"):
        calibrations.read_calibration(known.SerializeToString(), rest.SerializeToString())
    del known.K[5:]
    with pytest.raises(ValueError, match="a camera matrix has 5 values"):
        calibrations.read_calibration(known.SerializeToString(), rest.SerializeToString())
