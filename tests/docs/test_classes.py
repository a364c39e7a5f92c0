"""What docs/classes.md shows is run: five own classes from logs to a report and to what is played."""

import json
import re
import shlex
import shutil

import numpy as np
import pandas as pd
import pytest
from support.commands import run_command
from support.own_classes import FILE, MATRIX, PAGE
from support.pages import commands
from support.toy_world import street

from semgrid_eval.class_files import default_classes_text
from semgrid_eval.classes import DEFAULT_CLASSES, load_classes
from semgrid_eval.log.container import Container
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid
from semgrid_eval.log.store import write_log
from semgrid_eval.models.model import Given
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums
from semgrid_eval.scores.tidy import load_figures

pytestmark = pytest.mark.slow

NAMES = ("unknown", "drivable", "walkable", "fixed", "vehicle", "pedestrian")
CATEGORIES = ("surface", "obstacle", "traffic", "people")
RUN, REPORT, PLAY = commands(PAGE)
MODELS = ("newest", "all inputs", "table", "encoder-decoder", "residual")


def run(line):
    program, *arguments = shlex.split(line)
    assert program == "semgrid-eval"
    return run_command(arguments)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Where the commands of the page have run, on two streets."""
    folder = tmp_path_factory.mktemp("own")
    for split, number in (("train", 1), ("val", 2)):
        recording = street(number, frames=26, noise_px=0.05).recording(f"toy{number}", split)
        write_log(recording, folder / "logs" / split / f"toy{number}.mcap")
    (folder / "my_classes.yaml").write_text(FILE)
    (folder / "own.yaml").write_text(MATRIX)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in (RUN, REPORT, PLAY):
            ended = run(line)
            assert ended.code == 0, f"{line}\n{ended.err}"
    return folder


def records(place):
    record = results.read_run(place / "runs/own")
    return {row.name: results.read_result(place / "runs/own/results" / row.results[0]) for row in record.rows}


def test_results_name_the_set_and_are_counted_by_it(place):
    found = records(place)
    assert tuple(found) == MODELS
    for record in found.values():
        assert record.classes == load_classes(place / "my_classes.yaml")
        folder = place / "runs/own/results" / record.id
        counts = read_sums(folder, "iou", "all", record.classes)
        assert counts.shape == (1, 1, 6, 6)
        windows = results.read_windows(place / "runs/own", record.windows_id)
        predicted = results.read_predictions(folder)["prediction"]
        for target, prediction in np.ndindex(6, 6):
            cells = (windows["target"] == target) & (predicted == prediction) & ~windows["mask"]
            assert counts[0, 0, target, prediction] == cells.sum()
    assert np.unique(windows["target"]).tolist() == [0, 1, 2, 3, 4], "nobody walks on a toy's street"
    assert len({record.targets for record in found.values()}) == 1


def test_tables_have_a_column_for_each_class_and_category(place):
    report = place / "runs/own/report"
    summary = pd.read_csv(report / "summary.csv")
    iou = summary[(summary.metric == "iou") & (summary.division == "all") & (summary.row == "residual")]
    merged = [f"merged_{name}" for name in CATEGORIES]
    assert iou.column.tolist() == [*NAMES, *CATEGORIES, "mean_known", *merged]
    value = iou.set_index("column").value
    assert value["surface"] == pytest.approx((value["drivable"] + value["walkable"]) / 2)
    assert value["mean_known"] == pytest.approx(value[["drivable", "walkable", "fixed", "vehicle"]].mean())
    table = (report / "tables/categories.md").read_text()
    assert re.findall(r"Mean \(known\)|Surface|Obstacle|Traffic|People", table.splitlines()[0]) == [
        "Mean (known)", "Surface", "Obstacle", "Traffic", "People"
    ]  # fmt: skip
    tidy = load_figures(place / "runs/own", metrics=["iou"], partitions=["all"])
    assert set(tidy.column) == set(iou.column)


def test_the_page_has_these_classes_and_no_claim_of_the_paper(place):
    page = (place / "runs/own/report/index.html").read_text()
    for words in ("drivable", "pedestrian", "Surface", "Traffic", "People"):
        assert words in page
    for words in ("pole sign", "large vehicle", "Small dynamic", "--class-6:", "Small static", "Static"):
        assert words not in page
    assert "--class-1:#1c3353" in page
    assert "--class-1:#5a5aa0" in page
    assert "The paper&#39;s claims and values are about its own classes" in page
    record = json.loads((place / "runs/own/report/report.json").read_text())
    assert record["findings"] == []
    assert record["runs"][0]["scaling"] == ""


def test_what_is_played_has_their_names_and_colours(place):
    with Container(place / "own.mcap") as log:
        topics = {channel.topic for channel in log.summary.channels.values()}
        exact = [SemanticGrid.FromString(each.data) for each in log.messages(["/grid/prediction/1/exact"])]
    assert "/grid/legend" in topics
    assert tuple(exact[0].class_names) == NAMES
    assert max(exact[0].class_ids) < 6


def test_a_run_begins_where_it_was(place, monkeypatch):
    monkeypatch.chdir(place)
    before = records(place)
    assert run(RUN).code == 0
    assert records(place) == before
    inline = MATRIX.replace("classes: my_classes.yaml", f"classes: {json.dumps(_plain(place))}")
    (place / "inline.yaml").write_text(inline)
    assert run(RUN.replace("own.yaml", "inline.yaml")).code == 0
    assert {name: record.id for name, record in records(place).items()} == {n: r.id for n, r in before.items()}


def _plain(place):
    return load_classes(place / "my_classes.yaml").model_dump(mode="json")


def test_runs_of_other_classes_are_reported_apart(place, monkeypatch):
    monkeypatch.chdir(place)
    (place / "usual.yaml").write_text("rows: [{name: newest, model: newest}]\n")
    assert run("semgrid-eval run usual.yaml --logs logs --out runs/usual").code == 0
    both = run("semgrid-eval report runs/own runs/usual --out both")
    assert both.code == 1
    assert "has other classes than newest (own) of runs/own: report them apart" in both.err


def test_a_result_whose_classes_are_none_is_named_and_the_rest_goes_on(place, monkeypatch):
    monkeypatch.chdir(place)
    record = records(place)["table"]
    spoiled = record.model_copy(update={"config": record.config | {"grid": {"classes": {"categories": []}}}})
    folder = place / "runs/own/results" / record.id
    whole = (folder / "result.json").read_bytes()
    try:
        results.write_result(folder, spoiled)
        ended = run("semgrid-eval report runs/own --out spoiled")
    finally:
        (folder / "result.json").write_bytes(whole)
    assert ended.code == 1
    assert f"{record.id}: grid.classes: categories: must not be empty" in ended.err
    assert "residual" in (place / "spoiled/summary.csv").read_text()


def test_a_gate_knows_their_figures(place, monkeypatch):
    monkeypatch.chdir(place)
    shutil.copytree("runs/own", "runs/again")
    report = "semgrid-eval report runs/own runs/again --out gate --fail-below"
    refused = run(f"{report} 'road: -0.01'")
    assert refused.code == 1
    assert "fail-below: 'road' is not one of unknown, drivable, " in refused.err
    assert (
        "row newest: one recording alone has cells of surface: an interval needs more"
        in run(f"{report} 'surface: -0.01'").err
    )


def test_the_default_set_is_printed_to_begin_with():
    shown = re.search(r"`(grids --print-classes) > my_classes\.yaml` writes out the default set", PAGE)
    assert run(f"semgrid-eval {shown[1]}").out == default_classes_text()


def test_what_the_page_says_of_models_is_so():
    assert Given(("full",), 2, 8, 8, 1.0, translate=True).classes == DEFAULT_CLASSES
