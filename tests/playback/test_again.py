"""Every possible target, predicted again by what was scored, and rows side by side."""

import shutil

import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from support.exact_grids import read_exact
from support.small_runs import WINDOW, run, write_logs
from support.toy_world import FRAME_NS, START_NS

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import DEFAULT_CLASSES
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.grids.extent import extent_of
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log.predictions import PredictionLog
from semgrid_eval.models.checkpoint import WEIGHTS_FILE
from semgrid_eval.playback.export import export_predictions
from semgrid_eval.playback.write import Play, write_playback
from semgrid_eval.scores import results

pytestmark = pytest.mark.slow

ROWS = [
    {"name": "newest", "model": "newest"},
    {"name": "ed", "model": "ed"},
    {"name": "table", "model": "table"},
    {"name": "noisy", "model": "newest", "disturb": {"kind": "mislabelled", "strength": 0.2}},
    {"name": "coarse", "model": "newest", "grid": {"spec": {"cell_m": 1.0}}},
]
RECORDING = "toy_000002_000000"
TARGETS_NS = [START_NS + frame * FRAME_NS for frame in (6, 7, 8)]  # two inputs and the target are three frames apart


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Logs, a run that scores the last frame of each recording, and one that scores every frame that it can."""
    folder = tmp_path_factory.mktemp("again")
    write_logs(folder / "logs")
    record = run(ROWS, folder / "logs", folder / "run")
    assert {row.failure for row in record.rows} == {None}
    run(ROWS[:4], folder / "logs", folder / "every", window={**WINDOW, "target_frame": None})
    (folder / "run" / "grids").symlink_to(folder / "grids")
    return folder


@pytest.fixture
def play(made, tmp_path):
    def played(*rows, run="run", **options):
        options = {"logs": made / "logs", "recording": RECORDING, **options}
        return write_playback(Play(made / run, rows, **options), tmp_path / "play.mcap")

    return played


def messages(log, topic):
    with log.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages([topic])
        return [(message.log_time, message.publish_time, message.data) for _, _, message in found]


def topics(log):
    with log.open("rb") as stream:
        return {channel.topic for channel in make_reader(stream).get_summary().channels.values()}


def predicted(run, row):
    """What a row has predicted for its windows of the recording, by the time of the target."""
    found = next(each for each in results.read_run(run).rows if each.name == row)
    folder = results.result_folder(run, found.results[0])
    windows, grids = results.read_result(folder).windows, results.read_predictions(folder)["prediction"]
    pairs = zip(windows, grids, strict=True)
    return {window.target_stamp_ns: grid for window, grid in pairs if window.recording == RECORDING}


@pytest.mark.parametrize("row", ["newest", "ed", "table", "noisy"])
def test_every_target_is_predicted_as_a_run_that_scores_it_predicts_it(made, play, row):
    assert list(predicted(made / "run", row)) == TARGETS_NS[-1:]
    written = play(row)
    assert written.notes == ()
    expected, found = predicted(made / "every", row), messages(written.log, "/grid/prediction/1/exact")
    assert [now_ns for now_ns, _, _ in found] == TARGETS_NS
    assert {now_ns - publish_ns for now_ns, publish_ns, _ in found} == {3 * FRAME_NS}
    for now_ns, _, data in found:
        np.testing.assert_array_equal(read_exact(data)[0], expected[now_ns])
    around = [f"/grid/{what}/exact" for what in ("target", "mask/1", "input/1/1", "input/1/1/before_1")]
    again = [messages(written.log, topic) for topic in around]
    kept = play(row, run="every", logs=None).log
    assert again == [messages(kept, topic) for topic in around]


def test_a_log_begins_with_its_first_target(play):
    log = play("ed").log
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary.statistics.message_start_time == TARGETS_NS[0]
    for topic in ("/grid/target", "/grid/prediction/1", "/tf", "/camera/front/image", "/grid/legend"):
        assert messages(log, topic)[0][0] == TARGETS_NS[0], topic


def test_only_what_says_how_sure_it_is_has_certainty(play):
    assert {topic for topic in topics(play("newest", "ed").log) if "certainty" in topic} == {
        "/grid/certainty/2",
        "/grid/certainty/2/picture",
    }


def test_weights_are_found_by_the_results_id_and_by_nothing_else(made, play, tmp_path):
    kept = made / "run" / "trainings"
    (training,) = kept.iterdir()
    assert play("ed", trainings=tmp_path / "nowhere").notes == (
        "row ed: only what was scored of it is played: "
        f"{tmp_path}/nowhere: its training is not among them; name their folder with --trainings",
    )
    shutil.copytree(training, tmp_path / "renamed" / "0123456789abcdef")
    written = play("newest", "ed", trainings=tmp_path / "renamed")
    assert len(written.notes) == 1
    assert [now_ns for now_ns, _, _ in messages(written.log, "/grid/prediction/2")] == TARGETS_NS[-1:]
    assert [now_ns for now_ns, _, _ in messages(written.log, "/grid/prediction/1")] == TARGETS_NS
    shutil.copytree(training, tmp_path / "moved" / training.name)
    assert play("ed", trainings=tmp_path / "moved").notes == ()
    weights = tmp_path / "moved" / training.name / WEIGHTS_FILE
    weights.write_bytes(weights.read_bytes()[:-1])
    assert str(weights) in play("ed", trainings=tmp_path / "moved").notes[0]


def test_what_cannot_learn_again_is_played_as_scored_and_says_why(made, play, tmp_path):
    shutil.copytree(made / "logs", tmp_path / "fewer")
    (tmp_path / "fewer" / "train" / "toy0.mcap").unlink()
    written = play("table", logs=tmp_path / "fewer")
    assert written.notes == (
        "row table: only what was scored of it is played: "
        f"{tmp_path}/fewer: what it would learn here, from these logs, is not what it has learned",
    )
    assert [now_ns for now_ns, _, _ in messages(written.log, "/grid/target")] == TARGETS_NS[-1:]


def test_answers_that_were_made_elsewhere_are_played_as_scored(made, play, tmp_path):
    export_predictions(made / "run", "newest", tmp_path / "answers")
    rows = [{"name": "log", "model": "log", "settings": {"folder": str(tmp_path / "answers")}}]
    run(rows, made / "logs", tmp_path / "run")
    written = play("log", run=tmp_path / "run")
    assert written.notes == ("row log: only what was scored of it is played: its answers were made elsewhere",)
    assert [now_ns for now_ns, _, _ in messages(written.log, "/grid/prediction/1/exact")] == TARGETS_NS[-1:]


def test_a_scored_window_stays_as_it_was_scored_and_a_difference_is_told(made, play, tmp_path):
    shutil.copytree(made / "run", tmp_path / "run", symlinks=True)
    (folder,) = (
        results.result_folder(tmp_path / "run", row.results[0])
        for row in results.read_run(tmp_path / "run").rows
        if row.name == "ed"
    )
    arrays = results.read_predictions(folder)
    arrays["prediction"][:, :64] = 0
    write_arrays(folder / results.PREDICTIONS_FILE, arrays, owner=folder.name)
    written = play("ed", run=tmp_path / "run")
    assert f"of the cells of the windows that were scored of {RECORDING} would be predicted otherwise here" in " ".join(
        written.notes
    )
    shown = {now_ns: read_exact(data)[0] for now_ns, _, data in messages(written.log, "/grid/prediction/1/exact")}
    assert not shown[TARGETS_NS[-1]][:64].any()
    assert shown[TARGETS_NS[0]][:64].any()


def test_rows_lie_side_by_side_with_one_target_for_all(made, play):
    log = play("ed", "newest").log
    for number, row in enumerate(("ed", "newest"), start=1):
        found = messages(log, f"/grid/prediction/{number}/exact")
        assert [now_ns for now_ns, _, _ in found] == TARGETS_NS
        np.testing.assert_array_equal(read_exact(found[-1][2])[0], predicted(made / "run", row)[TARGETS_NS[-1]])
        (name,) = messages(log, f"/grid/prediction/{number}/name")
        assert SceneUpdate.FromString(name[2]).entities[0].texts[0].text == row
    assert len(messages(log, "/grid/target")) == 3
    assert len(messages(log, "/grid/mask/2")) == 3


def test_the_rows_of_a_played_log_are_predictions_by_their_topics(made, play):
    log, extent = play("ed", "newest").log, extent_of(GridSpec(), DEFAULT_CLASSES)
    with (
        PredictionLog(log) as read,
        pytest.raises(LogError, match="/grid/prediction/1/exact, /grid/prediction/2/exact"),
    ):
        _ = read.topic
    for number, row in enumerate(("ed", "newest"), start=1):
        with PredictionLog(log, f"/grid/prediction/{number}/exact") as read:
            assert read.recording == RECORDING
            last = list(read.predictions(extent))[-1]
        assert (last.certainty is None) == (row == "newest")
        np.testing.assert_array_equal(last.classes, predicted(made / "run", row)[TARGETS_NS[-1]])


def test_the_same_command_gives_the_same_bytes(made, tmp_path):
    files = [tmp_path / name / "play.mcap" for name in ("a", "b")]
    for file in files:
        write_playback(Play(made / "run", ("ed", "table"), made / "logs"), file)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_rows_with_targets_of_another_kind_are_refused(play):
    with pytest.raises(InputError, match="row coarse: its targets are other grids than those of newest"):
        play("newest", "coarse")
