import json
import math
import re
import shutil
from collections import Counter

import numpy as np
import pytest
import yaml
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from mcap.reader import make_reader
from support.exact_grids import read_exact
from support.independent_reader import of_topic, read, reader_script, sha256
from support.toy_world import FRAME_NS, street

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError, SemgridError
from semgrid_eval.log.codec import stamp_ns
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.playback.write import GAP_NS, Play, write_playback
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results

YAW_RATE_RADPS = 0.3
ROAD = CLASS_NAMES.index("road")
ROWS = [
    {"name": "BL-DC", "model": "newest"},
    {"name": "two sensors/1", "model": "overlay", "sensors": ["split2_upper", "split2_lower"]},
    {"name": "BL-x", "model": "newest", "validation_split": "nowhere"},
]


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("playback") / "logs"
    for i, turning in enumerate((YAW_RATE_RADPS, 0.0)):
        world = street(i, frames=20, yaw_rate_radps=turning)
        write_log(world.recording(f"toy{i}"), folder / "val" / f"toy{i}.mcap")
    return folder


@pytest.fixture(scope="module")
def run(logs):
    """Each log gives two recordings of ten frames, each recording four windows."""
    window = {"step_frames": 3, "target_frame": None}
    file = logs.parent / "m.yaml"
    file.write_text(yaml.safe_dump({"defaults": {"window": window, "grid": {"stretch_frames": 10}}, "rows": ROWS}))
    out = logs.parent / "run"
    run_matrix(load_matrix(str(file)), logs, out, RunOptions("cpu", logs.parent / "grids", "test"))
    return out


def kept(run, name):
    """The record of a row's result and all arrays of its windows."""
    row = next(row for row in results.read_run(run).rows if row.name == name)
    folder = results.result_folder(run, row.results[0])
    record = results.read_result(folder)
    windows = results.read_windows(run, record.windows_id)
    return record, {**windows, **results.read_predictions(folder)}


def write(run, row, out, **options):
    """Play one row."""
    return write_playback(Play(run, (row,), **options), out)


def played(path, topic):
    """Log time, publish time and data of a topic's messages."""
    with path.open("rb") as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages([topic])
        return [(message.log_time, message.publish_time, message.data) for _, _, message in messages]


def exact(path, topic):
    return [read_exact(data)[0] for _, _, data in played(path, f"{topic}/exact")]


def test_every_message_is_decoded_by_an_independent_reader(run, logs, tmp_path):
    write(run, "two sensors/1", tmp_path / "play.mcap", logs=logs)
    found = read(reader_script(), tmp_path / "play.mcap")
    assert found["done"]
    inputs = [f"/grid/input/1/{sensor}{older}" for sensor in (1, 2) for older in ("", "/before_1")]
    grids = [*inputs, "/grid/target", "/grid/mask/1", "/grid/prediction/1"]
    shown = [f"{topic}/picture" for topic in grids if "mask" not in topic and "before" not in topic]
    around = dict.fromkeys(("/tf", *(f"/camera/front/{name}" for name in ("image", "label", "calibration"))), 4)
    once = dict.fromkeys(("/grid/legend", "/grid/prediction/1/name"), 1)
    each = dict.fromkeys([*grids, *shown, *(f"{topic}/exact" for topic in grids)], 4)
    assert Counter(m["topic"] for m in found["messages"]) == {**each, **around, **once}
    record, arrays = kept(run, "two sensors/1")
    prediction = of_topic(found, "/grid/prediction/1/exact")
    assert [m["value"]["class_ids"] for m in prediction] == [
        sha256(grid.tobytes()) for grid in arrays["prediction"][:4]
    ]
    assert {m["schema"] for m in of_topic(found, "/grid/prediction/1")} == {"foxglove.Grid"}
    assert {m["schema"] for m in of_topic(found, "/grid/prediction/1/picture")} == {"foxglove.CompressedImage"}
    stamps = [(str(w.target_stamp_ns), str(w.input_stamps_ns[-1])) for w in record.windows[:4]]
    assert [(m["log_ns"], m["publish_ns"]) for m in prediction] == stamps
    rows = [{"row": "two sensors/1", "result": record.id, "seed": None}]
    assert json.loads(found["metadata"]["semgrid.playback"]["rows"]) == rows


def test_grids_are_those_of_the_run_at_the_times_they_hold_for(run, logs, tmp_path):
    write(run, "BL-DC", tmp_path / "play.mcap", logs=logs, recording="toy1#2")
    record, arrays = kept(run, "BL-DC")
    at = [i for i, window in enumerate(record.windows) if window.recording == "toy1#2"]
    path = tmp_path / "play.mcap"
    for topic, expected in (
        ("/grid/target", arrays["target"]),
        ("/grid/mask/1", arrays["mask"]),
        ("/grid/prediction/1", arrays["prediction"]),
        ("/grid/input/1/1", arrays["inputs"][:, 0, -1]),
        ("/grid/input/1/1/before_1", arrays["inputs"][:, 0, 0]),
    ):
        assert np.array_equal(exact(path, topic), expected[at]), topic
    targets = [10**18 + frame * FRAME_NS for frame in range(16, 20)]
    for topic, back in (("/grid/target", 0), ("/grid/input/1/1", 3), ("/grid/input/1/1/before_1", 6)):
        times = [(log, publish) for log, publish, _ in played(path, topic)]
        assert times == [(now, now - back * FRAME_NS) for now in targets], topic


def test_pictures_of_the_windows_time_come_from_the_log(run, logs, tmp_path):
    write(run, "BL-DC", tmp_path / "play.mcap", logs=logs, recording="toy0#2")
    with LogReader(logs / "val" / "toy0.mcap") as log:
        source = [entry[:3] for entry in log.messages(["/camera/front/image"])][16:]
    shown = [
        ("/camera/front/image", log_ns, data)
        for log_ns, _, data in played(tmp_path / "play.mcap", "/camera/front/image")
    ]
    assert shown == source


def road_in_odom(path, *, turned=True):
    """Centres (N, 2) of the road cells of all targets in the odom frame, as a viewer places them, and the last yaw."""
    placed = {
        now: next(part for part in FrameTransforms.FromString(data).transforms if part.child_frame_id == "grid")
        for now, _, data in played(path, "/tf")
    }
    centres = []
    for now, _, data in played(path, "/grid/target"):
        grid, moved = Grid.FromString(data), placed[now]
        cells = np.frombuffer(grid.data, np.uint8).reshape(-1, grid.column_count, grid.cell_stride)[..., 4]
        y, x = np.nonzero(cells == ROAD)
        x = (x + 0.5) * grid.cell_size.x + grid.pose.position.x
        y = (y + 0.5) * grid.cell_size.y + grid.pose.position.y
        yaw_rad = 2 * math.atan2(moved.rotation.z, moved.rotation.w) if turned else 0.0
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        across = (cosine * x - sine * y + moved.translation.x, sine * x + cosine * y + moved.translation.y)
        centres.append(np.stack(across, axis=-1))
    return np.concatenate(centres), yaw_rad


def test_grids_of_a_later_stretch_of_a_turning_drive_lie_where_the_street_is(run, logs, tmp_path):
    for number in (1, 2):
        write(run, "BL-DC", tmp_path / f"{number}.mcap", logs=logs, recording=f"toy0#{number}")
    (early_m, early_yaw_rad), (late_m, late_yaw_rad) = (road_in_odom(tmp_path / f"{n}.mcap") for n in (1, 2))
    unturned_m, _ = road_in_odom(tmp_path / "2.mcap", turned=False)
    assert early_yaw_rad == pytest.approx(0.0)
    assert late_yaw_rad == pytest.approx(YAW_RATE_RADPS * 10 * FRAME_NS * 1e-9)
    for road_m in (early_m, late_m):  # the street runs along x and is 12 m wide
        assert len(road_m) > 1000
        assert np.abs(road_m[:, 1]).max() == pytest.approx(6.0, abs=0.6)
    assert np.abs(unturned_m[:, 1]).max() > 7.5


def test_all_recordings_follow_each_other_a_second_apart(run, logs, tmp_path):
    written = write(run, "BL-DC", tmp_path / "all.mcap", logs=logs, every_recording=True)
    assert written.recordings == ("toy0#1", "toy0#2", "toy1#1", "toy1#2")
    times = [log_ns for log_ns, _, _ in played(written.log, "/tf")]
    gaps = np.diff(times)
    assert np.flatnonzero(gaps != FRAME_NS).tolist() == [3, 7, 11]
    assert set(gaps[[3, 7, 11]].tolist()) == {GAP_NS}
    assert times[0] == 10**18 + 6 * FRAME_NS, "the first recording keeps its times, and begins with its first target"
    for topic in ("/grid/target", "/grid/prediction/1"):
        found = played(written.log, topic)
        assert len(found) == 16
        assert [stamp_ns(Grid.FromString(data).timestamp) for _, _, data in found] == [now for now, _, _ in found]
    leads = {log_ns - publish_ns for log_ns, publish_ns, _ in played(written.log, "/grid/prediction/1")}
    assert leads == {3 * FRAME_NS}


def test_same_input_gives_same_bytes(run, logs, tmp_path):
    files = [tmp_path / name / "play.mcap" for name in ("a", "b")]
    for file in files:
        write(run, "BL-DC", file, logs=logs, every_recording=True)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert sorted(path.name for path in files[0].parent.iterdir()) == ["play.layout.json", "play.mcap"]


def test_without_logs_there_are_grids_alone(run, tmp_path):
    written = write(run, "BL-DC", tmp_path / "play.mcap")
    with written.log.open("rb") as stream:
        names = {channel.topic for channel in make_reader(stream).get_summary().channels.values()}
    assert {name.split("/")[1] for name in names} == {"grid", "tf"}
    assert len(played(written.log, "/tf")) == len(played(written.log, "/grid/target")) == 4


@pytest.mark.parametrize(
    ("row", "options", "message"),
    [
        ("nope", {}, "there is no row 'nope', only BL-DC, two sensors/1, BL-x"),
        ("BL-x", {}, "row BL-x: it has no result: no recording of split 'nowhere' gave grids"),
        (
            "BL-DC",
            {"recording": "toy9"},
            "row BL-DC: there is no scored recording 'toy9', only toy0#1, toy0#2, toy1#1, toy1#2",
        ),
        ("BL-DC", {"logs": "absent"}, "absent: is not a folder"),
        ("BL-DC", {"logs": "empty"}, "empty/val/toy0.mcap: cannot be read: No such file or directory"),
        ("BL-DC", {"logs": "other"}, "other/val/toy0.mcap: has digest"),
    ],
)
def test_a_users_mistake_is_told_and_leaves_nothing(run, logs, tmp_path, row, options, message):
    (tmp_path / "empty").mkdir()
    (tmp_path / "other" / "val").mkdir(parents=True)
    shutil.copy(logs / "val" / "toy1.mcap", tmp_path / "other" / "val" / "toy0.mcap")
    if "logs" in options:
        options = {"logs": tmp_path / options["logs"]}
    with pytest.raises(SemgridError, match=re.escape(message)) as error:
        write(run, row, tmp_path / "out" / "play.mcap", **options)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.rglob("play*"))


def test_a_log_to_train_on_may_have_the_same_path_as_one_to_score(run, logs, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    record = results.read_run(copy)
    same_paths = tuple(log.model_copy(update={"digest": f"{i:016x}"}) for i, log in enumerate(record.logs))
    results.write_run(copy, record.model_copy(update={"logs": same_paths + record.logs}))
    assert write(copy, "BL-DC", tmp_path / "play.mcap", logs=logs).recordings == ("toy0#1",)


def test_a_row_that_kept_no_predictions_is_told(run, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("predictions.npz"))
    with pytest.raises(InputError, match="row BL-DC: none of its results kept its predictions"):
        write(copy, "BL-DC", tmp_path / "play.mcap")


def test_arrays_of_another_shape_are_refused(run, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    for path in copy.glob("windows/*.npz"):
        arrays = results.read_arrays(path, ("inputs", "target", "mask"))
        write_arrays(path, {**arrays, "target": arrays["target"][:, :-1]}, owner=path.stem)
    with pytest.raises(InputError, match=r"target: has shape \(16, 127, 128\), not \(16, 128, 128\)"):
        write(copy, "BL-DC", tmp_path / "play.mcap")


def test_a_log_is_never_overwritten(run, logs):
    before = (logs / "val" / "toy0.mcap").read_bytes()
    with pytest.raises(InputError, match=r"toy0.mcap: lies in the folder of logs"):
        write(run, "BL-DC", logs / "val" / "toy0.mcap", logs=logs)
    assert (logs / "val" / "toy0.mcap").read_bytes() == before
