import numpy as np
import pytest

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import ResultError


def test_arrays_come_back_and_equal_arrays_give_equal_bytes(tmp_path):
    arrays = {"a": np.arange(12, dtype=np.int64).reshape(3, 4), "b": np.array(["x", "yz"])}
    for name in ("one.npz", "two.npz"):
        write_arrays(tmp_path / name, arrays)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    back = read_arrays(tmp_path / "one.npz", ("a", "b"))
    for name, array in arrays.items():
        np.testing.assert_array_equal(back[name], array)


def test_a_flipped_bit_or_a_cut_gives_an_error_of_ours_or_the_same_arrays(tmp_path):
    path = tmp_path / "a.npz"
    whole = {"counts": np.arange(200, dtype=np.int64).reshape(2, 10, 10)}
    write_arrays(path, whole)
    good = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(1500):
        data = bytearray(good)
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        path.write_bytes(data if rng.random() < 0.8 else data[: rng.integers(len(data))])
        try:
            found = read_arrays(path, ("counts",))["counts"]
        except ResultError:
            refused += 1
        else:
            np.testing.assert_array_equal(found, whole["counts"])
    assert refused > 1000


def test_an_absent_array_or_file_is_named(tmp_path):
    write_arrays(tmp_path / "a.npz", {"a": np.zeros(1)})
    with pytest.raises(ResultError, match=r"a\.npz: has no array b$"):
        read_arrays(tmp_path / "a.npz", ("b",))
    with pytest.raises(ResultError, match=r"none\.npz: cannot be read"):
        read_arrays(tmp_path / "none.npz", ("b",))
