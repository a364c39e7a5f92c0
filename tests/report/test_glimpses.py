import shlex
from dataclasses import replace

import pytest

from semgrid_eval.report.glimpses import Glimpses, times
from semgrid_eval.report.reading import load_runs
from semgrid_eval.scores.results import read_run, write_run


def row_of(run, name):
    return next(row for row in load_runs([run])[0].rows if row.record.name == name)


def with_command(run, command, folder):
    """Give a run's record another command line, in a folder of its own."""
    write_run(folder, read_run(run).model_copy(update={"command": command}))
    return Glimpses(folder)


@pytest.mark.parametrize(
    ("command", "where"),
    [
        ("semgrid-eval run m --logs logs --out runs/first", ["runs/first", "logs"]),
        ("semgrid-eval run m --logs='my logs' --out 'a b' --row ED", ["a b", "my logs"]),
        ("semgrid-eval run m --logs town --validation-logs real --out run", ["run", "real"]),
        ("semgrid-eval demo --out demo", ["RUN", "LOGS"]),
        ("semgrid-eval run 'unfinished", ["RUN", "LOGS"]),
        ("", ["RUN", "LOGS"]),
    ],
)
def test_a_window_is_played_from_the_folders_of_the_runs_own_command(seen, tmp_path, command, where):
    row = row_of(seen, "own-DC")
    window = row.shown.record.windows[0].model_copy(update={"recording": "it's $HOME #2"})
    words = shlex.split(with_command(seen, command, tmp_path).play_command(row, window))
    expected = [where[0], "own-DC", "--logs", where[1], "--recording", "it's $HOME #2", "--out", "play.mcap"]
    assert words == ["semgrid-eval", "play", *expected]


def test_pictures_of_a_log_are_found_by_its_path(seen):
    result = row_of(seen, "own-DC").shown
    window = result.record.windows[1]
    kept = Glimpses(seen).of(window.log, result)
    assert {window.target_stamp_ns, *window.input_stamps_ns} <= kept.frames.keys()


def test_what_was_not_kept_is_none(seen):
    kept, result = Glimpses(seen), row_of(seen, "own-DC").shown
    assert kept.of("val/another.mcap", result) is None
    assert kept.of("val/toy0.mcap", result) is not None
    rear = replace(result, record=result.record.model_copy(update={"config": {"grid": {"camera": "rear"}}}))
    assert kept.of("val/toy0.mcap", rear) is None


def test_a_log_to_train_on_may_have_the_same_path_as_one_to_score(seen, tmp_path):
    result, record = row_of(seen, "own-DC").shown, read_run(seen)
    same_paths = tuple(log.model_copy(update={"digest": f"{i:016x}"}) for i, log in enumerate(record.logs))
    write_run(tmp_path, record.model_copy(update={"logs": same_paths + record.logs}))
    (tmp_path / "pictures").symlink_to(seen / "pictures")
    assert Glimpses(tmp_path).of(result.record.windows[0].log, result) is not None


def test_times_can_be_pasted_into_viewers(seen):
    result = row_of(seen, "own-DC").shown
    window = result.record.windows[0]
    kept = Glimpses(seen).of(window.log, result)
    assert times(window.target_stamp_ns, kept) == (
        "1000000000470588232 ns",
        "1000000000.470588232 s",
        "0.471 s into the log",
        "2001-09-09 01:46:40.470 UTC",
    )
    assert times(1_234_567_890, None) == ("1234567890 ns", "1.234567890 s")
