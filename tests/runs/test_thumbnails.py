import dataclasses
import io
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml
from PIL import Image
from support.own_clock import with_own_motion
from support.single import RIG, single_rig
from support.toy_world import FRAME_NS, HEIGHT, START_NS, WIDTH, png, street

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.files import read_json
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import LABEL_ID, label_palette
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.colour import read_size
from semgrid_eval.recording.png import decode_ids
from semgrid_eval.report.page.write import write_report
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.runs.thumbnails import log_pictures, small_image, small_label
from semgrid_eval.scores import results
from semgrid_eval.scores.thumbnails import FramePictures, pictures_file, read_pictures
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import ColourFrom, LidarSensor

SHORT = {"name": "BL-DC", "model": "newest", "window": {"step_frames": 3, "target_frame": 8}}
LONG = {"name": "BL-late", "model": "newest", "window": {"step_frames": 2, "target_frame": 8, "horizon_steps": 2}}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictured") / "logs"
    for i in range(2):
        write_log(street(i, frames=9).recording(f"toy{i}"), folder / "val" / f"toy{i}.mcap")
    return folder


def run(logs, out, *rows, executor=None, **options):
    file = out.parent / f"{out.name}.yaml"
    file.write_text(yaml.safe_dump({"rows": list(rows)}))
    options = RunOptions("cpu", out.parent / "grids", "test", grid_executor=executor or InProcess(), **options)
    return run_matrix(load_matrix(str(file)), logs, out, options)


def digest(log):
    with LogReader(log) as reader:
        return reader.digest


def kept_frames(out, log):
    """Indices of the frames of a log whose pictures a run keeps."""
    pictures = read_pictures(pictures_file(out, digest(log), GridConfig())).frames
    return [(stamp - START_NS) // FRAME_NS for stamp in sorted(pictures)]


def files(folder):
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in (folder / "pictures").iterdir()}


def test_pictures_of_the_frames_in_windows_are_kept_and_no_others(logs, tmp_path):
    run(logs, tmp_path / "run", SHORT, LONG)
    for log in logs.rglob("*.mcap"):
        assert kept_frames(tmp_path / "run", log) == [2, 4, 5, 8]  # inputs 2, 5 and 2, 4 and the target 8


def test_pictures_show_what_the_camera_saw(logs, tmp_path):
    run(logs, tmp_path / "run", SHORT)
    log = logs / "val" / "toy1.mcap"
    with LogReader(log) as reader:
        frames = {frame.stamp_ns: frame for frame in reader.frames("front", images=True)}
    for stamp_ns, kept in read_pictures(pictures_file(tmp_path / "run", digest(log), GridConfig())).frames.items():
        frame = frames[stamp_ns]
        assert np.array_equal(decode_ids(kept.label), decode_ids(frame.label_png))
        shown = np.asarray(Image.open(io.BytesIO(kept.image)).convert("RGB"), int)
        source = np.asarray(Image.open(io.BytesIO(frame.image_file)).convert("RGB"), int)
        assert shown.shape == source.shape
        assert np.abs(shown - source).mean() < 6


def test_large_pictures_become_small_and_keep_their_shape_and_side():
    image = np.zeros((400, 1000, 3), np.uint8)
    image[:100, :500] = (30, 60, 250)  # BGR: red, top left
    small = np.asarray(Image.open(io.BytesIO(small_image(png(image)))).convert("RGB"), int)
    assert small.shape == (102, 256, 3)
    assert np.abs(small[:24, :126] - (250, 60, 30)).max() < 30
    assert small[28:].max() < 30
    assert small[:, 132:].max() < 30


def test_labels_are_sampled_not_mixed_and_have_their_colours():
    ids = np.full((300, 600), LABEL_ID["road"], np.uint8)
    ids[:150, 200:] = LABEL_ID["bicycle"]
    picture = Image.open(io.BytesIO(small_label(png(ids))))
    assert picture.size == (256, 128)
    small = np.asarray(picture)
    assert set(np.unique(small)) == {LABEL_ID["road"], LABEL_ID["bicycle"]}
    assert (small[:64, 86:] == LABEL_ID["bicycle"]).all()
    colours = np.asarray(picture.convert("RGB"))
    assert np.array_equal(colours, label_palette()[small])


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff\xe0 a photo", png(np.zeros((9, 9, 3), np.uint8))[:60]])
def test_what_cannot_be_decoded_is_told(data):
    for small in (small_image, small_label):
        with pytest.raises(InputError, match=r"(PNG|JPEG) file"):
            small(data)


def with_broken_image(recording, stamp_ns):
    """Break the colour image of one moment: its pixels are cut short, and all checksums hold."""

    def moments():
        for moment in recording.moments():
            frame = moment.cameras["front"]
            if moment.stamp_ns == stamp_ns:
                image_file = png(np.zeros((9, 9, 3), np.uint8))[:33] + png(np.zeros((1, 1, 3), np.uint8))[33:]
                frame = replace(frame, image_file=image_file)
            yield replace(moment, cameras={"front": frame})

    return replace(recording, moments=moments)


def test_a_second_start_makes_nothing_and_a_later_row_adds_its_frames(logs, tmp_path):
    run(logs, tmp_path / "run", SHORT)
    before = files(tmp_path / "run")
    run(logs, tmp_path / "run", SHORT)
    assert files(tmp_path / "run") == before
    run(logs, tmp_path / "run", SHORT, LONG)
    run(logs, tmp_path / "both", SHORT, LONG)
    assert {name: data for name, (data, _) in files(tmp_path / "run").items()} == {
        name: data for name, (data, _) in files(tmp_path / "both").items()
    }


def test_several_processes_give_the_same_bytes_and_lost_files_come_back(logs, tmp_path):
    run(logs, tmp_path / "run", SHORT)
    before = {name: data for name, (data, _) in files(tmp_path / "run").items()}
    first, second = sorted((tmp_path / "run" / "pictures").iterdir())
    first.unlink()
    second.write_bytes(b"junk")
    run(logs, tmp_path / "run", SHORT, executor=Processes(2))
    assert {name: data for name, (data, _) in files(tmp_path / "run").items()} == before


def test_pictures_change_no_result_and_can_be_left_out(logs, tmp_path):
    with_pictures = run(logs, tmp_path / "with", SHORT)
    without = run(logs, tmp_path / "without", SHORT, pictures=False)
    assert with_pictures.rows == without.rows
    assert not (tmp_path / "without" / "pictures").exists()


def without_images(recording):
    """Take the camera's colour images out of a recording."""

    def moments():
        for moment in recording.moments():
            cameras = {name: dataclasses.replace(frame, image_file=None) for name, frame in moment.cameras.items()}
            yield dataclasses.replace(moment, cameras=cameras)

    return dataclasses.replace(recording, moments=moments)


def test_a_log_without_images_gives_labels_alone(tmp_path):
    write_log(without_images(street(1, frames=9).recording("dark")), tmp_path / "logs" / "dark.mcap")
    record = run(tmp_path / "logs", tmp_path / "run", SHORT)
    assert record.rows[0].failure is None
    pictures = read_pictures(
        pictures_file(tmp_path / "run", digest(tmp_path / "logs" / "dark.mcap"), GridConfig())
    ).frames
    assert [(bool(each.image), bool(each.label)) for each in pictures.values()] == [(False, True)] * 3
    before = files(tmp_path / "run")
    run(tmp_path / "logs", tmp_path / "run", SHORT)
    assert files(tmp_path / "run") == before


def test_frames_that_a_log_does_not_have_stay_empty_and_another_log_gives_none(logs):
    log = logs / "val" / "toy0.mcap"
    assert log_pictures(log, digest(log), GridConfig(), [7]).frames == {7: FramePictures()}
    rear = GridConfig(sensors={"full": CameraSensor(camera="rear")})
    for known, grid, message in (
        ("another", GridConfig(), "has digest"),
        (digest(log), rear, "'rear' is not front, the only choice"),
    ):
        with pytest.raises(LogError, match=message):
            log_pictures(log, known, grid, [START_NS])


@pytest.mark.parametrize("integrator", ["euler", "arc"])
def test_the_track_moves_as_the_grids_do_where_frames_lie_between_motion_samples(tmp_path, integrator):
    path, grid = tmp_path / "toy.mcap", GridConfig(integrator=integrator)
    write_log(with_own_motion(street(0, frames=12).recording()), path)
    (recording,) = build_log(path, grid)
    track = log_pictures(path, digest(path), grid, []).track
    np.testing.assert_array_equal(track.stamps_ns, recording.stamps_ns)
    poses = [SE2(*pose) for pose in track.poses]
    seen = [pose.seen_from(poses[0]) for pose in poses]
    np.testing.assert_allclose([(pose.x_m, pose.y_m) for pose in seen], recording.position_m, atol=1e-12)
    np.testing.assert_allclose([pose.yaw_rad for pose in seen], recording.yaw_rad, atol=1e-12)
    assert np.ptp(recording.yaw_rad) > 0.01


def test_the_track_is_kept_with_the_camera_that_sees_it(logs, tmp_path):
    run(logs, tmp_path / "run", SHORT)
    log = logs / "val" / "toy0.mcap"
    track = read_pictures(pictures_file(tmp_path / "run", digest(log), GridConfig())).track
    assert track.start_ns == track.stamps_ns[0] == START_NS
    assert (np.diff(track.stamps_ns) == FRAME_NS).all()
    assert np.allclose(track.poses[:, 0], 8.0 * FRAME_NS * 1e-9 * np.arange(9))  # the toy drives straight at 8 m/s
    assert not track.poses[:, 1:].any()
    world = street(0)
    u, v = 40, 100  # a pixel that sees the road
    label, depth_m = world.render((0.0, 0.0, 0.0))
    assert label[v, u] == LABEL_ID["road"]
    origin_m, ray = world._rays((0.0, 0.0, 0.0))
    point_m = [origin_m[i] + depth_m[v, u] * ray[i][v, u] for i in range(3)]
    x, y, w = track.projection @ [*point_m, 1.0]
    assert (x / w * WIDTH - 0.5, y / w * HEIGHT - 0.5, w) == pytest.approx((u, v, depth_m[v, u]))


def test_a_damaged_image_of_a_log_is_named_on_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr("semgrid_eval.log.writer.require_whole", read_size)  # as another writer would
    for i in range(2):
        recording = street(i, frames=9).recording(f"toy{i}")
        recording = with_broken_image(recording, START_NS + 5 * FRAME_NS) if i else recording
        write_log(recording, tmp_path / "logs" / "val" / f"toy{i}.mcap")
    run(tmp_path / "logs", tmp_path / "run", SHORT)
    run(tmp_path / "logs", tmp_path / "run", SHORT, LONG)  # what was found once is known
    damages = []
    page = write_report(tmp_path / "run", damaged=damages.append)
    fault = f"image at {START_NS + 5 * FRAME_NS} ns is a damaged PNG file"
    assert [failure["name"] for failure in read_json(page.parent / "report.json")["failures"]] == ["toy1"]
    assert fault in page.read_text()
    assert damages == []  # the run's own files are whole


def test_a_log_that_is_damaged_after_its_grids_were_built_costs_no_result(logs, tmp_path, caplog):
    copy = tmp_path / "logs"
    shutil.copytree(logs, copy)
    run(copy, tmp_path / "first", SHORT, pictures=False)
    log = copy / "val" / "toy0.mcap"
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 255  # in a chunk; the index, and so the digest, is as before
    log.write_bytes(data)
    record = run(copy, tmp_path / "second", SHORT)
    assert record.rows[0].failure is None
    assert len(results.read_result(results.result_folder(tmp_path / "second", record.rows[0].results[0])).windows) == 2
    assert len(files(tmp_path / "second")) == 1
    assert [text for text in caplog.messages if text.startswith(f"{log}: is damaged")]


def test_a_camera_without_disparity_gives_the_same_pictures_and_projection(tmp_path):
    grid = GridConfig(sensors={"top": LidarSensor(colour_from=ColourFrom(camera="left"))}, target=("top",))
    stereo = replace(single_rig(frames=4), calibrations={name: WORLD.calibration(name) for name in WORLD.cameras})
    stereo = replace(stereo, moments=lambda: _with_disparity(single_rig(frames=4).moments()))
    kept = []
    for name, recording in (("single", single_rig(frames=4)), ("stereo", stereo)):
        path = tmp_path / f"{name}.mcap"
        write_log(recording, path)
        kept.append(log_pictures(path, digest(path), grid, [START_NS]))
    assert kept[0].frames == kept[1].frames
    assert kept[0].frames[START_NS].image
    np.testing.assert_array_equal(kept[0].track.projection, kept[1].track.projection)
    assert kept[0].track.projection.any()


WORLD = street(1, frames=4, cameras=RIG)


def _with_disparity(moments):
    disparity = png(np.full((HEIGHT, WIDTH), 500, np.uint16))
    for moment in moments:
        cameras = {name: replace(frame, disparity_png=disparity) for name, frame in moment.cameras.items()}
        yield replace(moment, cameras=cameras)
