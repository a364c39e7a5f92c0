import json

import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.streams.profile import LatencyProfile, read_profile, spread, write_profile

PLAIN = {
    "format": 1,
    "made_by": {"command": "semgrid-eval latency logs", "version": "0.1.0", "machine": {"processor": "a quick one"}},
    "stages": {"decode": [4.0, 5.0, 60.0], "grid": [1.5, 1.25, 20.0], "align": [0.5, 0.25, 0.125]},
    "models": {"mine.py:Mine": [30.0, 31.0, 300.0], "fuse": [2, 3, 4]},
}


def changed(file, *, inside=(), **changes):
    value = json.loads(json.dumps(PLAIN))
    place = value
    for key in inside:
        place = place[key]
    place.update(changes)
    file.write_text(json.dumps(value))
    return file


@pytest.fixture
def profile(tmp_path):
    return read_profile(changed(tmp_path / "profile.json"))


def test_a_profile_is_read_as_it_was_written(profile, tmp_path):
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    write_profile(first, profile)
    assert read_profile(first) == profile
    write_profile(second, read_profile(first))
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.json", "profile.json", "second.json"]


def test_a_chain_takes_the_sum_of_its_stages_frame_by_frame(profile):
    np.testing.assert_array_equal(profile.chain_ms(None), [6.0, 6.5, 80.125])
    np.testing.assert_array_equal(profile.chain_ms("mine.py:Mine"), [36.0, 37.5, 380.125])
    np.testing.assert_array_equal(profile.chain_ms("fuse"), [8.0, 9.5, 84.125])


def test_the_order_of_stages_in_the_file_does_not_matter(tmp_path):
    turned = dict(reversed(PLAIN["stages"].items()))
    found = read_profile(changed(tmp_path / "turned.json", stages=turned))
    assert found.chain_ms(None).tolist() == [6.0, 6.5, 80.125]


def test_a_model_that_was_not_measured_is_an_error_that_names_the_others(profile, tmp_path):
    for ask in (profile.chain_ms, lambda name: profile.draw_ns(name, 3, seed=0)):
        with pytest.raises(InputError, match=r"model ed: was not measured; the profile has: mine.py:Mine, fuse"):
            ask("ed")
    without = read_profile(changed(tmp_path / "without.json", models={}))
    with pytest.raises(InputError, match="the profile has: none"):
        without.chain_ms("fuse")
    assert len(without.draw_ns(None, 4, seed=0)) == 4


def test_draws_are_whole_frames_each_as_often_as_the_others(profile):
    drawn = profile.draw_ns("fuse", 9000, seed=5)
    assert drawn.dtype == np.int64
    values, counts = np.unique(drawn, return_counts=True)
    assert values.tolist() == [8_000_000, 9_500_000, 84_125_000]  # never a slow stage with the quick ones of another
    assert (np.abs(counts - 3000) < 250).all()


def test_the_same_seed_draws_the_same_on_every_machine(profile):
    drawn = profile.draw_ns("fuse", 8, seed=7)
    quick, slow, slowest = 8_000_000, 9_500_000, 84_125_000
    assert drawn.tolist() == [slowest, slow, slowest, slowest, slow, slowest, slowest, quick]
    assert profile.draw_ns("fuse", 3, seed=7).tolist() == drawn[:3].tolist()
    assert profile.draw_ns("fuse", 8, seed=8).tolist() != drawn.tolist()


def test_a_scale_multiplies_what_is_drawn(profile):
    plain = profile.draw_ns("fuse", 20, seed=1)
    assert profile.draw_ns("fuse", 20, seed=1, scale=0.5).tolist() == (plain // 2).tolist()
    assert not profile.draw_ns("fuse", 20, seed=1, scale=0.0).any()
    assert profile.draw_ns(None, 0, seed=1).tolist() == []
    for scale in (-1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="scale"):
            profile.draw_ns("fuse", 1, seed=1, scale=scale)


@pytest.mark.parametrize(
    ("inside", "change", "fault"),
    [
        (["stages"], {"grid": []}, r"stages\.grid: must not be empty"),
        (["stages"], {"grid": [1.0, -2.5, 3.0]}, r"stages\.grid\.1: must be at least 0, not -2\.5"),
        (["models"], {"fuse": [1.0, 2.0, float("nan")]}, r"models\.fuse\.2: .*finite.*not NaN"),
        (["models"], {"fuse": [float("inf"), 2.0, 3.0]}, r"models\.fuse\.0: .*finite.*not Infinity"),
        (["models"], {"fuse": ["4", 2.0, 3.0]}, r"models\.fuse\.0: .*, not '4'"),
        (["models"], {"fuse": [1.0, 2.0]}, r"models\.fuse has 2 samples, and stages\.decode has 3"),
        (["stages"], {"grid": [1.0, 2.0]}, r"stages\.grid has 2 samples, and stages\.decode has 3"),
        (["stages"], {"gird": [1.0, 2.0, 3.0]}, r"'gird' is not one of decode, segment, match, grid, align"),
        ([], {"stages": {}}, r"stages: must not be empty"),
        ([], {"format": 2}, r"format: 2 is not 1"),
        ([], {"when": "today"}, r"when: unknown key; allowed here: format, made_by, models, stages"),
        (["made_by"], {"date": "today"}, r"made_by\.date: unknown key; allowed here: command, machine, version"),
    ],
)
def test_what_is_wrong_with_a_profile_is_one_line_that_names_file_and_field(tmp_path, inside, change, fault):
    file = changed(tmp_path / "wrong.json", inside=inside, **change)
    with pytest.raises(InputError, match=rf"^{file}: .*{fault}") as caught:
        read_profile(file)
    assert "\n" not in str(caught.value)


def test_what_is_no_json_or_too_large_is_refused(tmp_path, monkeypatch):
    file = tmp_path / "wrong.json"
    file.write_text("{")
    with pytest.raises(InputError, match="is not valid JSON"):
        read_profile(file)
    monkeypatch.setattr("semgrid_eval.streams.profile._LIMIT_BYTES", 1 << 20)
    file.write_bytes(b" " * ((1 << 20) + 1))
    with pytest.raises(InputError, match="has 1048577 bytes, and 1048576 are allowed"):
        read_profile(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_profile(tmp_path / "missing.json")


def test_the_spread_of_samples():
    found = spread(list(range(1, 102)))
    assert (found.median_ms, found.p99_ms, found.max_ms) == (51.0, 100.0, 101.0)


def test_a_profile_made_in_memory_is_held_to_the_same():
    value = {**PLAIN, "stages": {"decode": (1.0,)}, "models": {"fuse": (1.0, 2.0)}}
    with pytest.raises(ValueError, match=r"models\.fuse has 2 samples"):
        LatencyProfile(**value)
