from dataclasses import replace

from semgrid_eval.report.examples.thumbnails import RunThumbnails, times
from semgrid_eval.report.rows.load import load_runs


def opened(folder, name="own-DC"):
    """What a run kept of its logs, and the shown result of a row."""
    (run,) = load_runs([folder])
    return RunThumbnails(run), next(row for row in run.rows if row.record.name == name).shown


def test_pictures_of_a_log_are_found_by_its_path(seen):
    kept, result = opened(seen)
    window = result.record.windows[1]
    assert {window.target_stamp_ns, *window.input_stamps_ns} <= kept.of(window.log, result).frames.keys()


def test_what_was_not_kept_is_none(seen):
    kept, result = opened(seen)
    assert kept.of("val/another.mcap", result) is None
    assert kept.of("val/toy0.mcap", result) is not None
    config = {"grid": {"sensors": {"full": {"camera": "rear"}}}}
    rear = replace(result, record=result.record.model_copy(update={"config": config}))
    assert opened(seen)[0].of("val/toy0.mcap", rear) is None


def test_a_log_to_train_on_may_have_the_same_path_as_one_to_score(seen, tmp_path):
    (run,) = load_runs([seen])
    same_paths = tuple(log.model_copy(update={"digest": f"{i:016x}"}) for i, log in enumerate(run.record.logs))
    mixed = replace(run, record=run.record.model_copy(update={"logs": same_paths + run.record.logs}))
    result = run.rows[0].shown
    assert RunThumbnails(mixed).of(result.record.windows[0].log, result) is not None


def test_times_can_be_pasted_into_viewers(seen):
    kept, result = opened(seen)
    window = result.record.windows[0]
    assert times(window.target_stamp_ns, kept.of(window.log, result)) == (
        "1000000000470588232 ns",
        "1000000000.470588232 s",
        "0.471 s into the log",
        "2001-09-09 01:46:40.470 UTC",
    )
    assert times(1_234_567_890, None) == ("1234567890 ns", "1.234567890 s")
