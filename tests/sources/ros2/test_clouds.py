from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ros_messages import cloud

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.clouds import Extras, columns_of, returned, times_of

READ = Extras(label="label", time="t")
TYPES = [("t", "u4"), ("x", "f4"), ("pad", "u1"), ("y", "f4"), ("z", "f4"), ("label", "u2"), ("ring", "u1")]


def points(count=6, types=TYPES):
    found = np.zeros(count, types)
    for place, name in enumerate(found.dtype.names):
        found[name] = 10 * place + np.arange(count)
    return found


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize(("rows", "padding"), [(1, 0), (1, 5), (3, 0), (2, 7)])
@pytest.mark.parametrize("place", ["f4", "f8"])
def test_fields_are_read_by_name_whatever_their_order_and_what_rows_end_with(big, rows, padding, place):
    types = [(name, place if name in "xyz" else each) for name, each in TYPES]
    found = columns_of(cloud(1, points(types=types), rows=rows, padding=padding, big=big), READ)
    assert found.dtype.names == ("x", "y", "z", "label", "t")
    for name in found.dtype.names:
        assert found[name].tolist() == points()[name].tolist()


def test_intensity_is_read_where_there_is_one():
    types = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "u1")]
    assert columns_of(cloud(1, points(types=types)), Extras())["intensity"].tolist() == [30, 31, 32, 33, 34, 35]
    assert columns_of(cloud(1, points(types=types[:3])), Extras()).dtype.names == ("x", "y", "z")


def test_a_cloud_may_have_no_points():
    assert len(columns_of(cloud(1, points(0)), READ)) == 0


def renamed(message, old, **changes):
    fields = [replace(each, **changes) if each.name == old else each for each in message.fields]
    return replace(message, fields=fields)


WHOLE = cloud(1, points(), rows=2)
FAULTS = {
    "no place": (renamed(WHOLE, "y", name="Y"), "has no field y; there are: t, x, pad, Y, z, label, ring"),
    "no label": (renamed(WHOLE, "label", name="rgb"), "has no field label; there are: t, x, pad, y, z, rgb, ring"),
    "no time": (renamed(WHOLE, "t", name="time"), "has no field t; there are: time, x, pad, y, z, label, ring"),
    "no fields": (replace(WHOLE, fields=[]), "has no field x; there are: none"),
    "two of a name": (renamed(WHOLE, "pad", name="z"), "has 2 fields z"),
    "whole place": (renamed(WHOLE, "z", datatype=5), "z is int32; it is read from float32, float64"),
    "real label": (
        renamed(WHOLE, "label", datatype=7),
        "label is float32; it is read from int8, uint8, int16, uint16, int32, uint32",
    ),
    "unknown type": (renamed(WHOLE, "x", datatype=9), "x is datatype 9; it is read from float32, float64"),
    "several": (renamed(WHOLE, "x", count=3), "x is 3 x float32; it is read from float32, float64"),
    "beyond": (renamed(WHOLE, "z", offset=17), "z begins at byte 17 and reaches beyond a point of 20 bytes"),
    "short rows": (replace(WHOLE, row_step=59), "row_step 59 is less than 3 points of 20"),
    "cut": (replace(WHOLE, data=WHOLE.data[:-1]), "has 119 bytes, which are not 2 rows of 60"),
    "long": (replace(WHOLE, height=1), "has 120 bytes, which are not 1 row of 60"),
    "huge": (replace(WHOLE, width=2**31), "has 2147483648 x 2 points; at most 4194304 are allowed"),
    "wide": (replace(WHOLE, point_step=2**31), "has points of 2147483648 bytes; at most 1024 are allowed"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_cloud_that_is_not_what_it_says_is_refused_before_anything_is_made_of_it(name):
    message, line = FAULTS[name]
    with pytest.raises(InputError) as raised:
        columns_of(message, READ)
    assert str(raised.value) == line


SMALL = st.integers(0, 70)
NUMBER = st.one_of(SMALL, st.integers(0, 2**32 - 1))


@given(NUMBER, NUMBER, NUMBER, NUMBER, st.integers(0, 130))
def test_whatever_a_cloud_says_of_its_size_there_are_points_or_a_line(width, height, point_step, row_step, count):
    changes = {"width": width, "height": height, "point_step": point_step, "row_step": row_step}
    message = replace(WHOLE, **changes, data=np.resize(WHOLE.data, count))
    with suppress(InputError):
        assert len(columns_of(message, READ)) == width * height


@given(st.sampled_from("xyzt"), NUMBER, st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_whatever_a_cloud_says_of_its_fields_there_are_points_or_a_line(name, offset, datatype, count):
    with suppress(InputError):
        assert len(columns_of(renamed(WHOLE, name, offset=offset, datatype=datatype, count=count), READ)) == 6


@pytest.mark.filterwarnings("error")
def test_points_that_are_signalling_nan_did_not_come_back_and_nothing_warns():
    found = columns_of(cloud(1, points(types=[(name, "f4") for name, _ in TYPES])), Extras(time="t"))
    for name in ("x", "t"):
        found[name].view("u4")[2:4] = 0x7F800001
    assert returned(found).tolist() == [True, True, False, False, True, True]
    assert times_of(found, "t").tolist() == [0, 1, 4, 5]
