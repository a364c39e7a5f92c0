from dataclasses import replace

import pytest
import yaml

from semgrid_eval.report.provenance import command_table, data_sets, duration, matrix_file, matrix_text
from semgrid_eval.report.reading import load_runs
from semgrid_eval.runs.matrix import load_matrix


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
    (found,) = load_runs([run])
    logs = found.record.logs
    first = logs[0].model_copy(update={"split": "train"})
    named = tuple(log.model_copy(update={"dataset": "town-v1/small"}) for log in (first, *logs[1:]))
    (text,) = data_sets(_with_logs(found, named))
    assert text.startswith("town-v1/small: 1 log of train and 7 logs of val; digest ")
    assert data_sets(_with_logs(found, named[::-1])) == [text]
    changed = named[0].model_copy(update={"digest": "0" * 16})
    assert data_sets(_with_logs(found, (changed, *named[1:]))) != [text]
    assert len(data_sets(_with_logs(found, (logs[0], *named[1:])))) == 2


def _with_logs(run, logs):
    return replace(run, record=run.record.model_copy(update={"logs": logs}))


def test_the_matrix_lies_beside_the_page(page):
    assert yaml.safe_load((page.parent / "matrix.yaml").read_text())["training"] == {"epochs": 6, "batch": 8}


@pytest.mark.parametrize(("seconds", "text"), [(9.94, "9.9 s"), (312.5, "5 min 12 s"), (7260, "2 h 1 min")])
def test_durations_are_short(seconds, text):
    assert duration(seconds) == text
