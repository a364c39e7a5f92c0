from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.bags import compressed, image

from semgrid_eval.classes import LABEL_ID
from semgrid_eval.errors import InputError
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.ros2.pictures import LabelTable, Shape, colour, depth_m, ids_of, shape_of

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


@pytest.mark.parametrize(
    ("ids", "given", "expected"),
    [
        ("label_ids", [7, 26], ["road", "car"]),
        ("train_ids", [0, 13, 255], ["road", "car", "unlabeled"]),
        ({"road": (3, 4), "person": (9,)}, [3, 4, 9], ["road", "road", "person"]),
    ],
)
def test_ids_become_label_ids(ids, given, expected):
    picture = ids_of(image(1, np.array([given], np.uint8), "mono8"))
    found = decode_gray(LabelTable(ids).label_png(picture), bit_depth=8)
    assert found.tolist() == [[LABEL_ID[name] for name in expected]]


@pytest.mark.parametrize(("ids", "strange"), [("label_ids", 34), ("train_ids", 19), ({"road": (1,)}, 0)])
def test_ids_that_are_not_named_are_refused(ids, strange):
    with pytest.raises(InputError, match=f"ids: {strange} is in a label image, but not in the map"):
        LabelTable(ids).label_png(np.array([[strange]], np.uint8))
