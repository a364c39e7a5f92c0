"""Colours of classes are shown and decide nothing: changing one makes nothing again, and is seen in what is shown."""

import yaml
from support.own_classes import FILE
from support.small_runs import run, write_logs

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.grids.build import grid_key
from semgrid_eval.grids.moved_actors import MovedActors
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.playback.refit import Sources, model_of, row_of
from semgrid_eval.playback.scored import read_scored
from semgrid_eval.report.claims.claims import has_papers_classes
from semgrid_eval.report.estimates.bootstrap import classes_of
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.data import grid_digest
from semgrid_eval.runs.row import Row, plan_units

OWN = yaml.safe_load(FILE)
PINK = [255, 105, 180]


def pink(classes):
    """The same set with another colour of its second class, as YAML has it."""
    return {
        **classes,
        "classes": [each | ({"colour": PINK} if i == 1 else {}) for i, each in enumerate(classes["classes"])],
    }


def ids(classes):
    row = Row(name="a", model="ed", grid=GridConfig(classes=classes))
    described = (row.given.described(), row.grid.target_identity(), MovedActors(("full",)).described(row.grid))
    return grid_key("log", row.grid), grid_digest(row.grid), *described, *plan_units([row], 0)


def test_no_id_depends_on_a_colour_and_each_on_what_classes_mean():
    own, other = (parse_config(ClassSet, each) for each in (OWN, pink(OWN)))
    assert own != other
    assert ids(own) == ids(other)
    default = DEFAULT_CLASSES.model_dump(mode="json")
    assert ids(parse_config(ClassSet, pink(default))) == ids(DEFAULT_CLASSES)
    labels = [each | {"labels": each["labels"][:-1]} if each.get("labels") else each for each in OWN["classes"]]
    changed = parse_config(ClassSet, {**OWN, "classes": labels})
    assert all(one != two for one, two in zip(ids(own), ids(changed), strict=True))
    assert all(one != two for one, two in zip(ids(own), ids(DEFAULT_CLASSES), strict=True))


def test_another_colour_trains_nothing_again_and_is_shown(tmp_path):
    logs, out = write_logs(tmp_path / "logs"), tmp_path / "run"
    rows = [{"name": "net", "model": "ed"}, {"name": "table", "model": "table"}]
    first = run(rows, logs, out, grid={"classes": OWN})
    made = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and path.name != "run.json"}
    again = run(rows, logs, out, grid={"classes": pink(OWN)})
    assert [row.results for row in again.rows] == [row.results for row in first.rows]
    assert {path: path.stat().st_mtime_ns for path in made} == made
    (loaded,) = load_runs([out])
    for row in loaded.rows:
        assert row.classes.palette()[1].tolist() == PINK
        assert row.results[0].grid.classes == row.classes
        scored = read_scored(out, row.record)
        assert scored.grid.classes == row.classes
        assert model_of(scored, row_of(scored), Sources(out, out / "trainings", tmp_path / "grids", logs)) is not None


def test_runs_in_other_colours_are_reported_together_in_those_of_the_first(tmp_path):
    logs = write_logs(tmp_path / "logs")
    for name, classes in (("a", OWN), ("b", pink(OWN))):
        run([{"name": name, "model": "newest"}], logs, tmp_path / name, grid={"classes": classes})
    runs = load_runs([tmp_path / "b", tmp_path / "a"])
    rows = [row for each in runs for row in each.rows]
    assert rows[0].targets == rows[1].targets
    assert classes_of(rows).palette()[1].tolist() == PINK


def test_default_classes_in_other_colours_are_the_papers(tmp_path):
    logs = write_logs(tmp_path / "logs")
    default = DEFAULT_CLASSES.model_dump(mode="json")
    run([{"name": "a", "model": "newest"}], logs, tmp_path / "run", grid={"classes": pink(default)})
    (loaded,) = load_runs([tmp_path / "run"])
    assert has_papers_classes(loaded)
    assert loaded.rows[0].classes.palette()[1].tolist() == PINK
    run([{"name": "a", "model": "newest"}], logs, tmp_path / "run")
    (loaded,) = load_runs([tmp_path / "run"])
    assert loaded.rows[0].classes == DEFAULT_CLASSES
    assert "classes" not in loaded.rows[0].results[0].record.config["grid"]
