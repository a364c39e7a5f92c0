"""A stream played as a viewer would have seen it: nothing before it is published, and everything where it lies."""

import math
import shutil
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from mcap.reader import make_reader
from support.small_runs import run
from support.toy_world import FRAME_NS, START_NS, street

from semgrid_eval.cli.main import cli
from semgrid_eval.errors import InputError
from semgrid_eval.log.codec import stamp_ns
from semgrid_eval.log.schemas.semantic_grid_pb2 import SemanticGrid
from semgrid_eval.log.store import write_log
from semgrid_eval.playback.write import Play, write_playback
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums

FRAMES, LATE_NS = 12, FRAME_NS * 3 // 2 + 1
WINDOW = {"inputs": 1, "step_frames": 2, "target_frame": None}
STREAM = {"latency_ms": LATE_NS / 1e6, "asked": "fixed"}
ROWS = {
    "moved": STREAM,
    "still": {**STREAM, "move": False},
    "exact": {"latency_ms": LATE_NS / 1e6, "asked": "exact", "rate_hz": 10.0},
    "late": {"latency_ms": 60_000},
    "plain": None,
}
TOPIC = "/grid/prediction/1"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Logs of one recording each for training and for validation, and a run of streams on them."""
    folder = tmp_path_factory.mktemp("live")
    for number, split in enumerate(("train", "val")):
        world = street(number, frames=FRAMES, speed_mps=12.0, yaw_rate_radps=0.3 * number)
        write_log(world.recording(f"toy{number}", split), folder / "logs" / split / f"toy{number}.mcap")
    rows = [
        {"name": name, "model": "newest", **({"stream": stream} if stream else {})} for name, stream in ROWS.items()
    ]
    record = run(rows, folder / "logs", folder / "run", window=WINDOW)
    assert {row.failure for row in record.rows} == {None}
    return folder


@pytest.fixture(scope="module")
def play(made):
    for name in ("moved", "still", "exact", "late"):
        write(made / "run", name, made / f"{name}.mcap", logs=made / "logs", live=True)
    return lambda name, topic: messages(made / f"{name}.mcap", topic)


def write(run, row, out, **options):
    """Play one row."""
    return write_playback(Play(run, (row,), **options), out)


def messages(path, topic):
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages([topic])
        return [(message.log_time, message.publish_time, message.data) for _, _, message in found]


def at(frame):
    return START_NS + round(frame * FRAME_NS)


def test_an_answer_appears_when_it_is_published_and_says_for_when_and_by_what_it_is(play):
    """One worker takes 1.5 frames: it begins at 0, 1.5 (with frame 1), 3, 4.5 (with frame 4), ..."""
    captures = [0, 1, 3, 4, 6, 7, 9]
    found = play("moved", f"{TOPIC}/exact")
    assert [log_ns for log_ns, _, _ in found] == [START_NS + (k + 1) * LATE_NS for k in range(7)]
    assert all(log_ns == publish_ns for log_ns, publish_ns, _ in found)
    read = [SemanticGrid.FromString(data) for _, _, data in found]
    assert [stamp_ns(message.capture_time) for message in read] == [at(frame) for frame in captures]
    assert [stamp_ns(message.timestamp) for message in read] == [at(frame + 2) for frame in captures]
    assert play("moved", TOPIC)[0][0] == found[0][0], "nothing is drawn before"


def test_answers_are_drawn_again_at_each_time_of_evaluation_and_targets_at_their_capture(play):
    drawn = [log_ns for log_ns, _, _ in play("moved", TOPIC)]
    published = {log_ns for log_ns, _, _ in play("moved", f"{TOPIC}/exact")}
    frames = {at(frame) for frame in range(2, FRAMES)}
    assert drawn == sorted(frames | published)
    for topic in ("/grid/target", "/grid/mask/1", "/grid/target/exact"):
        assert [log_ns for log_ns, _, _ in play("moved", topic)] == [at(frame) for frame in range(FRAMES)]


def places(play, name):
    """Where viewers draw the grid's corner in the odom frame at frames, by the answer: the publication's time."""
    frames = {log_ns: FrameTransforms.FromString(data).transforms for log_ns, _, data in play(name, "/tf")}
    found = {}
    for log_ns, publish_ns, data in play(name, "/grid/prediction/1"):
        if log_ns in frames:
            grid = next(part for part in frames[log_ns] if part.child_frame_id == "grid")
            corner, yaw_rad = Grid.FromString(data).pose.position, 2 * math.atan2(grid.rotation.z, grid.rotation.w)
            turn = np.array([[math.cos(yaw_rad), -math.sin(yaw_rad)], [math.sin(yaw_rad), math.cos(yaw_rad)]])
            place_m = turn @ [corner.x, corner.y] + [grid.translation.x, grid.translation.y]
            found.setdefault(publish_ns, []).append((place_m, (corner.x, corner.y)))
    return found


def test_what_moves_along_stays_where_it_is_in_the_world_and_what_does_not_stays_with_the_vehicle(play):
    moved, still = places(play, "moved"), places(play, "still")
    several = [drawn for drawn in moved.values() if len(drawn) > 1]
    assert len(several) > 2
    for (first_m, first), (second_m, second) in (pair for drawn in several for pair in pairwise(drawn)):
        np.testing.assert_allclose(first_m, second_m, atol=1e-6)
        assert first[0] - second[0] == pytest.approx(12.0 * FRAME_NS * 1e-9, abs=0.02)
    assert len({corner for drawn in still.values() for _, corner in drawn}) == 1


def test_at_the_time_that_it_is_for_an_answer_lies_in_the_place_of_the_vehicle_then(play):
    exact = {publish_ns: SemanticGrid.FromString(data) for _, publish_ns, data in play("moved", f"{TOPIC}/exact")}
    away_m = {True: [], False: []}
    for log_ns, publish_ns, data in play("moved", TOPIC):
        corner = Grid.FromString(data).pose.position
        away_m[log_ns == stamp_ns(exact[publish_ns].timestamp)].append((corner.x, corner.y + 50.0))
    assert len(away_m[True]) == 4  # the others are published just after the frame that they are for
    np.testing.assert_allclose(away_m[True], 0.0, atol=1e-9)
    away_ahead_m = [x_m for x_m, _ in away_m[False]]
    assert min(away_ahead_m) < -0.5 < 0.3 < max(away_ahead_m)  # behind when it is late, ahead when it is early


def record(made, name):
    row = next(row for row in results.read_run(made / "run").rows if row.name == name)
    return results.read_result(results.result_folder(made / "run", row.results[0]))


@pytest.mark.parametrize("name", ["moved", "still", "exact"])
def test_a_stream_that_was_played_scores_as_recorded_answers_to_the_count(made, play, tmp_path, name):
    (tmp_path / "logged").mkdir()
    shutil.copy(made / f"{name}.mcap", tmp_path / "logged")
    how = {"recorded": True, "move": name != "still", **({"rate_hz": 10.0} if name == "exact" else {})}
    row = {"name": "logged", "model": "log", "settings": {"folder": str(tmp_path / "logged")}, "stream": how}
    assert run([row], made / "logs", tmp_path / "run", window=WINDOW).rows[0].failure is None
    (folder,) = (tmp_path / "run" / "results").iterdir()
    expected, found = (
        read_sums(each, "iou", "all") for each in (results.result_folder(made / "run", record(made, name).id), folder)
    )
    np.testing.assert_array_equal(found, expected)


def test_an_answer_for_one_time_of_evaluation_is_there_at_that_time_alone(play):
    times = [log_ns for log_ns, _, _ in play("exact", "/grid/prediction/1")]
    assert times == [log_ns for log_ns, _, _ in play("exact", "/grid/prediction/1/exact")]
    assert times == [log_ns for log_ns, _, _ in play("exact", "/grid/target")][1:]


def test_streams_lie_side_by_side_each_as_it_is_alone(made, play, tmp_path):
    written = write_playback(Play(made / "run", ("moved", "still"), made / "logs", live=True), tmp_path / "both.mcap")
    for number, name in enumerate(("moved", "still"), start=1):
        for form in ("", "/exact", "/picture"):
            alone = play(name, f"/grid/prediction/1{form}")
            assert messages(written.log, f"/grid/prediction/{number}{form}") == alone, (name, form)
    assert messages(written.log, "/grid/target") == play("moved", "/grid/target")
    with pytest.raises(InputError, match="row plain: is scored window by window"):
        write_playback(Play(made / "run", ("moved", "plain"), live=True), tmp_path / "mixed.mcap")


def test_of_answers_that_come_after_the_end_nothing_is_drawn(play):
    assert len(play("late", "/grid/target")) == FRAMES
    assert play("late", "/grid/prediction/1") == play("late", "/grid/certainty/1") == []


@pytest.mark.parametrize(
    ("row", "options", "fault"),
    [
        ("plain", {"live": True}, "row plain: is scored window by window and has no stream to play"),
        ("moved", {}, "row moved: is a stream and has no windows; `play --stream` shows it"),
        ("moved", {"live": True, "recording": "toy7"}, "there is no kept recording 'toy7', only toy1"),
    ],
)
def test_what_cannot_be_played_is_told(made, tmp_path, row, options, fault):
    with pytest.raises(InputError, match=fault):
        write(made / "run", row, tmp_path / "a.mcap", **options)
    assert not list(tmp_path.iterdir())


def test_the_command_plays_without_logs_and_gives_the_same_bytes_twice(made, tmp_path):
    for name in ("a", "b"):
        place = tmp_path / name / "play.mcap"
        done = CliRunner().invoke(cli, ["play", str(made / "run"), "moved", "--stream", "--out", str(place)])
        assert done.exit_code == 0, done.output
    assert (tmp_path / "a" / "play.mcap").read_bytes() == (tmp_path / "b" / "play.mcap").read_bytes()
    assert "3D!input" not in (tmp_path / "a" / "play.layout.json").read_text()
    done = CliRunner().invoke(cli, ["play", str(made / "run"), "moved", "--stream", "--all", "--out", "c.mcap"])
    assert done.exit_code == 2


def test_a_kept_stream_that_is_damaged_is_told_and_made_again(made, tmp_path):
    for name in ("run", "logs"):
        shutil.copytree(made / name, tmp_path / name)
    (loaded,) = load_runs([tmp_path / "run"])
    assert loaded.damages == ()
    file = results.result_folder(tmp_path / "run", record(made, "moved").id) / results.STREAM_FILE
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    (fault,) = load_runs([tmp_path / "run"])[0].damages
    assert (fault.kind, fault.name) == ("stream", str(file.relative_to(tmp_path / "run")))
    assert "stream.npz" in results.fault_of(file.parent, with_predictions=True)
    run([{"name": "moved", "model": "newest", "stream": STREAM}], tmp_path / "logs", tmp_path / "run", window=WINDOW)
    assert results.is_done(file.parent, with_predictions=True)
