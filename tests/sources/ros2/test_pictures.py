from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.ros_messages import compressed, image

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.pictures import Shape, colour, depth_m, shape_of

RNG = np.random.default_rng(4)
BGR = RNG.integers(0, 256, (5, 7, 3), dtype=np.uint8)


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [("bgr8", BGR), ("rgb8", BGR[..., ::-1]), ("bgra8", np.dstack([BGR, BGR[..., :1]]))],
)
def test_colour_has_one_order_whatever_the_encoding(encoding, pixels, padding):
    message = image(1, pixels, encoding, padding=padding)
    assert np.array_equal(colour(message), BGR)
    assert shape_of(message) == Shape(encoding, 7, 5)


def test_compressed_colour_has_the_same_order():
    assert np.array_equal(colour(compressed(1, cv2.imencode(".png", BGR)[1].tobytes(), "png")), BGR)


def test_gray_stays_gray():
    assert np.array_equal(colour(image(1, BGR[..., 0], "mono8")), BGR[..., 0])


def test_depth_is_in_metres_in_either_order_of_bytes():
    millimetres = np.array([[0, 1, 65535], [1234, 2, 3]], np.uint16)
    message = image(1, millimetres, "16UC1", padding=2)
    swapped = replace(image(1, millimetres.byteswap(), "16UC1"), is_bigendian=1)
    for each in (message, swapped):
        assert np.allclose(depth_m(each), millimetres / 1000)
    metres = np.array([[0.5, np.nan, np.inf]], np.float32)
    assert np.array_equal(depth_m(image(1, metres, "32FC1")), metres, equal_nan=True)


def test_bytes_that_do_not_make_the_picture_are_refused():
    message = image(1, BGR, "bgr8")
    for broken in (replace(message, data=message.data[:-1]), replace(message, step=20), replace(message, height=6)):
        with pytest.raises(InputError, match=r"data: \d+ bytes in lines of \d+ are not 7 x \d of bgr8"):
            colour(broken)
