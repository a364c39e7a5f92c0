"""The fuzzer finds what it is for, and, in its short form, finds nothing in the package."""

import importlib.util
import random
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from support.damage import CHUNK, flipped, stretches
from support.fuzzing import KINDS
from support.fuzzing_texts import corpus
from support.fuzzing_ways import Kind, anyhow, words
from support.mutations import KINDS as KEPT

from semgrid_eval.errors import InputError

TOOL = Path(__file__).parents[2] / "tools" / "fuzz.py"
COUNTS = {
    "log": 60,
    "recovery": 60,
    "resealed log": 60,
    "png": 200,
    "resealed png": 200,
    "json": 200,
    "yaml": 60,
    "bag": 40,
    "cloud": 40,
}


@pytest.fixture(scope="module")
def fuzz():
    spec = importlib.util.spec_from_file_location("fuzz", TOOL)
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz"] = module  # where its classes are looked for
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", COUNTS)
def test_nothing_is_found_in_a_short_run(fuzz, tmp_path, name):
    tally = fuzz.run_kind(name, KINDS[name], COUNTS[name], tmp_path)
    assert tally.failures == []
    assert tally.outcomes.total() == COUNTS[name]
    assert tally.outcomes["refused"] > COUNTS[name] // 20
    assert tally.outcomes["refused"] < COUNTS[name] or name in ("log", "recovery")  # some changes mean nothing


def test_kinds_of_one_run_do_not_get_in_each_others_way(fuzz, tmp_path, capsys):
    outcomes, failures = fuzz.run_kinds(COUNTS, 1, 600.0, tmp_path)
    assert (outcomes.total(), failures) == (len(COUNTS), [])
    assert len(capsys.readouterr().out.splitlines()) == len(COUNTS)


def test_every_kind_that_a_run_keeps_is_fuzzed():
    assert KINDS.keys() == COUNTS.keys() | KEPT.keys()


def kind(read, **changes):
    return replace(Kind(lambda folder: {"a": b"whole", "b": b"other"}, read, anyhow), **changes)


def reading(path, outcome):
    """A reader of our own: whole files are read, and others end in some way."""

    def read(folder, name):
        data = (folder / name).read_bytes()
        return data if data in (b"whole", b"other") else outcome(data)

    return read


def fail(error):
    raise error


@pytest.mark.parametrize(
    ("outcome", "expected"),
    [
        (lambda data: data, "silently wrong"),
        (lambda data: fail(InputError("is damaged")), "refused"),
        (lambda data: fail(ValueError("no line of ours")), "traceback"),
        (lambda data: fail(InputError("")), "more than a line"),
        (lambda data: [fail(AssertionError) for _ in data], "traceback"),
    ],
)
def test_what_becomes_of_a_case_is_told(fuzz, tmp_path, outcome, expected):
    tally = fuzz.run_kind("own", kind(reading(tmp_path, outcome)), 20, tmp_path)
    if expected == "traceback":
        tally.outcomes.pop("silently wrong", None)  # of nothing left to read
    assert set(tally.outcomes) == {expected}
    assert bool(tally.failures) is (expected != "refused")
    assert (tmp_path / "a").read_bytes() == b"whole"


def test_what_has_no_checksum_may_be_read_as_it_is(fuzz, tmp_path):
    tally = fuzz.run_kind("own", kind(reading(tmp_path, len), has_checksums=False), 20, tmp_path)
    assert tally.outcomes == Counter(other=20)


def test_a_hang_is_told(fuzz, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "HANG_S", 1)

    def forever(data):
        while True:
            pass

    tally = fuzz.run_kind("own", kind(reading(tmp_path, forever)), 1, tmp_path)
    assert tally.outcomes == Counter(hang=1)


def test_cases_are_the_same_each_time_and_none_is_whole(fuzz):
    inputs = {"a": b"whole", "b": b"other"}
    first, again = ([each.data for each in fuzz.cases("own", kind(None), inputs, 50)] for _ in range(2))
    assert first == again
    assert len(set(first)) > 40
    assert not set(first) & {b"whole", b"other"}


def test_failures_are_kept_beside_what_became_of_them(fuzz, tmp_path):
    tally = fuzz.run_kind("own", kind(reading(tmp_path, lambda data: fail(ValueError("why")))), 3, tmp_path)
    fuzz.keep(tally.failures, tmp_path / "kept")
    case = tally.failures[0][0]
    place = tmp_path / "kept" / "own" / f"{case.number}-{case.name}"
    assert place.read_bytes() == case.data
    assert "ValueError: why" in place.with_name(f"{place.name}.txt").read_text()


@pytest.mark.parametrize("text", corpus("yaml", "contract").values())
def test_words_are_changed_in_any_text(text):
    changed = {words({"a": text}, "a", random.Random(seed)) for seed in range(20)}
    assert len(changed) > 10


def test_a_recovery_that_saves_what_was_not_there_or_leaves_out_what_was_is_found(tmp_path):
    recovery = KINDS["recovery"]
    inputs = recovery.inputs(tmp_path)
    whole = inputs["small.mcap"]
    first, second = [each for each in stretches(whole) if each.opcode == CHUNK][:2]
    damaged = flipped(whole, first.end - 30)
    recovery.put(tmp_path, "small.mcap", damaged)
    found = recovery.read(tmp_path, "small.mcap")
    assert recovery.agrees(whole, damaged, None, found)
    assert not recovery.agrees(whole, damaged, None, (found[0], inputs["long.mcap"]))
    assert not recovery.agrees(whole, flipped(whole, second.end - 30), None, found)
