import re
from dataclasses import replace

import pytest
import yaml

from semgrid_eval.report.page.provenance import (
    command_table,
    data_sets,
    duration,
    failures,
    log_table,
    matrix_file,
    matrix_text,
)
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.scores.results import read_run
from semgrid_eval.sources.benchmarks import load_benchmark


def test_every_row_has_its_command_and_says_what_became_of_it(run):
    lines = {body[0].header: body[0].cells for body in command_table(load_runs([run])).bodies}
    assert lines["ED-DC"][1].text == "3 seeds"
    assert lines["BL-DC"][1].text == "no training"
    assert lines["ED-NT"][1].text == "failed"
    assert lines["ED-NT"][2].text == "semgrid-eval run smoke --logs logs --out run --row ED-NT"


@pytest.mark.parametrize("preset", ["paper-cpu", "sensitivity"])
def test_the_matrix_beside_the_page_means_the_same_as_the_one_that_was_run(run, preset, tmp_path):
    (found,) = load_runs([run])
    matrix = load_matrix(preset)
    found = replace(found, record=found.record.model_copy(update={"matrix": matrix.model_dump(mode="json")}))
    path = tmp_path / matrix_file(found, [found])
    path.write_text(matrix_text(found))
    assert load_matrix(str(path)) == matrix


def test_data_sets_are_named_with_their_logs_and_a_digest_that_tells_them_apart(run):
    logs = read_run(run).logs
    first = logs[0].model_copy(update={"split": "train"})
    named = tuple(log.model_copy(update={"dataset": "town-v1/small"}) for log in (first, *logs[1:]))
    (text,) = data_sets(with_logs(run, named))
    assert re.fullmatch("town-v1/small: 1 log of train and 7 logs of val; digest [0-9a-f]{16}", text)
    assert data_sets(with_logs(run, named[::-1])) == [text]
    changed = named[0].model_copy(update={"digest": "0" * 16})
    assert data_sets(with_logs(run, (changed, *named[1:]))) != [text]
    assert len(data_sets(with_logs(run, (logs[0], *named[1:])))) == 2


def with_logs(run, logs):
    return read_run(run).model_copy(update={"logs": logs})


@pytest.mark.parametrize(
    ("chosen", "fingerprints", "said"),
    [
        (slice(None), {}, "; all, as published"),
        (slice(3), {}, "; 3 of 420, as published"),
        (slice(3), {1: "0" * 16}, "; 1 of 3 are not as published"),
        (slice(3), {2: None}, "; 1 of 3 are not as published"),  # damaged where grids do not look
        (slice(1), {0: None}, ""),  # a run of an older version
    ],
)
def test_a_benchmarks_logs_are_held_against_the_published_ones(run, chosen, fingerprints, said):
    (first, *_) = read_run(run).logs
    published = load_benchmark("town-v1").sizes["small"].fingerprints.split()
    logs = [
        first.model_copy(update={"dataset": "town-v1/small", "fingerprint": f"{start}{'0' * 8}", "digest": start})
        for start in published[chosen]
    ]
    for index, fingerprint in fingerprints.items():
        logs[index] = logs[index].model_copy(update={"fingerprint": fingerprint})
    (text,) = data_sets(with_logs(run, (*logs, logs[0])))  # one is there twice: to train on and to score
    assert re.search("digest [0-9a-f]{16}(.*)", text)[1] == said


def test_only_a_benchmarks_logs_are_held_against_anything(run):
    logs = tuple(log.model_copy(update={"fingerprint": "0" * 16}) for log in read_run(run).logs)
    assert "published" not in data_sets(with_logs(run, logs))[0]


def test_the_matrix_lies_beside_the_page(page):
    assert yaml.safe_load((page.parent / "matrix.yaml").read_text())["training"] == {"epochs": 6, "batch": 8}


@pytest.mark.parametrize(("seconds", "text"), [(9.94, "9.9 s"), (312.5, "5 min 12 s"), (7260, "2 h 1 min")])
def test_durations_are_short(seconds, text):
    assert duration(seconds) == text


def test_logs_without_checksums_are_told(run):
    logs = read_run(run).logs
    (text,) = data_sets(with_logs(run, (logs[0].model_copy(update={"checksums": False}), *logs[1:])))
    assert "; 1 of 8 without checksums, so that damage to them cannot be seen" in text
    (found,) = load_runs([run])
    found = replace(found, record=with_logs(run, (logs[0].model_copy(update={"checksums": False}), *logs[1:])))
    assert [body[0].cells[-1].text for body in log_table([found]).bodies] == ["none", *["yes"] * 7]


def test_recovered_logs_and_skipped_rows_are_named_beside_failures(run):
    record = read_run(run)
    first, *others = record.logs
    record = record.model_copy(
        update={"logs": (first.model_copy(update={"recovered": "was recovered, 3 messages are lost"}), *others)}
    )
    (found,) = load_runs([run])
    lacking = found.rows[0].record.model_copy(update={"results": (), "skipped": "holds no exact pictures"})
    rows = (replace(found.rows[0], record=lacking, results=(), failures=()), *found.rows[1:])
    found = replace(found, record=record, rows=rows)
    told = {(each.kind, each.name): each.reason for each in failures([found])}
    assert told["log", first.path] == "was recovered, 3 messages are lost"
    assert told["skipped row", "BL-DC"] == "holds no exact pictures"
    assert command_table([found]).bodies[0][0].cells[1].text == "skipped"
    assert not found.rows[0].is_left
