"""Which images of Argoverse are taken: by time, so that a lost one neither shifts the others nor leaves a hole."""

import pytest

pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")

from semgrid_eval.sources.argoverse2.pairs import LEFT, RIGHT
from semgrid_eval.sources.argoverse2.taken import ALONE, BESIDE_HOLE, OUTSIDE, Every, Span, on_raster, take

MS = 1_000_000
PERIOD_NS, LATE_NS = 50 * MS, 1 * MS
ALWAYS = Span(0, 10**12)
RING = "ring_front_left"


def write(log, camera, numbers, late_ns=0):
    folder = log / "sensors" / "cameras" / camera
    folder.mkdir(parents=True)
    for number in numbers:
        (folder / f"{number * PERIOD_NS + late_ns}.jpg").touch()


def write_pairs(log, count, *, left_lost=(), right_lost=()):
    write(log, LEFT, [number for number in range(count) if number not in left_lost])
    write(log, RIGHT, [number for number in range(count) if number not in right_lost], LATE_NS)


def numbers_of(stamps_ns):
    return [stamp_ns / PERIOD_NS for stamp_ns in stamps_ns]


def pairs_taken(log, every=2, span=ALWAYS):
    taken = take(log, Every(stereo=every, ring=0), span)
    return numbers_of(pair.stamp_ns for pair in taken.pairs), +taken.lost


@pytest.mark.parametrize("lost", ["left_lost", "right_lost"])
def test_a_pair_lost_between_two_that_are_taken_changes_nothing(tmp_path, lost):
    write_pairs(tmp_path, 9, **{lost: [3]})
    assert pairs_taken(tmp_path) == ([0, 2, 4, 6, 8], {ALONE: 1})


@pytest.mark.parametrize(
    ("lost", "alone"),
    [({"left_lost": [4]}, 1), ({"right_lost": [4]}, 1), ({"left_lost": [4, 5], "right_lost": [4, 5]}, 0)],
)
def test_the_longest_part_without_a_hole_is_taken(tmp_path, lost, alone):
    write_pairs(tmp_path, 13, **lost)
    numbers, found = pairs_taken(tmp_path)
    assert numbers == [6, 8, 10, 12]
    assert (found[BESIDE_HOLE], found[ALONE]) == (4, alone)


def test_what_is_beyond_the_boxes_does_not_count_as_longest(tmp_path):
    write_pairs(tmp_path, 13, right_lost=[4])
    numbers, found = pairs_taken(tmp_path, every=1, span=Span(PERIOD_NS, 6 * PERIOD_NS))
    assert numbers == [1, 2, 3]
    assert found == {OUTSIDE: 14, ALONE: 1, BESIDE_HOLE: 4}


def test_ring_images_may_have_holes_and_keep_their_raster(tmp_path):
    write(tmp_path, RING, [number for number in range(12) if number not in (3, 6)])
    taken = take(tmp_path, Every(stereo=0, ring=2), Span(PERIOD_NS, 9 * PERIOD_NS))
    assert numbers_of(taken.rings[RING]) == [2, 4, 8]
    assert +taken.lost == {OUTSIDE: 3}


def test_steps_a_little_longer_than_the_median_do_not_add_up():
    """A third of the steps is 2 ms longer: 400 of them are 5 periods late, and yet no image is passed over."""
    stamps_ns, now_ns = [], 0
    for number in range(400):
        stamps_ns.append(now_ns)
        now_ns += PERIOD_NS + 2 * MS * (number % 3 == 0)
    assert list(on_raster(stamps_ns, 2).values()) == stamps_ns[::2]
    assert list(on_raster(stamps_ns, 2)) == list(range(200))


@pytest.mark.parametrize("stamps_ns", [[], [7]])
def test_of_few_times_all_are_taken(stamps_ns):
    assert list(on_raster(stamps_ns, 2).values()) == stamps_ns


def test_a_name_beyond_all_times_is_not_one(tmp_path):
    write(tmp_path, RING, [1])
    (tmp_path / "sensors" / "cameras" / RING / f"{10**19 - 1}.jpg").touch()
    assert numbers_of(take(tmp_path, Every(0, 1), ALWAYS).rings[RING]) == [1]
