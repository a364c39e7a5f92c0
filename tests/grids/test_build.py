import numpy as np
import pytest
from support.toy_world import Box, ToyWorld, street

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.errors import LogError
from semgrid_eval.executors import Processes
from semgrid_eval.grids.build import build_grids, build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log.store import write_log
from semgrid_eval.sensors.camera import CameraSensor

POLE = CLASS_NAMES.index("pole_sign")
CELL_M = GridSpec().cell_m


def built(world, folder, config=GridConfig(), **changes):  # noqa: B008 - frozen
    path = folder / "toy.mcap"
    write_log(world.recording(**changes), path)
    return build_log(path, config)[0]


def moved(grid, rows, columns):
    """Shift content by whole cells, one cell after the other."""
    result = np.zeros_like(grid)
    for row, column in np.argwhere(grid != UNKNOWN):
        r, c = row + rows, column + columns
        if 0 <= r < grid.shape[0] and 0 <= c < grid.shape[1]:
            result[r, c] = grid[row, column]
    return result


def agreement(recording, gap, extra=(0, 0)):
    """Share of cells known at both of two times, `gap` frames apart, that hold the same class, over all such pairs."""
    equal = known = 0
    for first in range(len(recording.stamps_ns) - gap):
        way_m = recording.position_m[first + gap] - recording.position_m[first]
        rows, columns = np.rint(way_m / CELL_M).astype(int) + np.array(extra)
        early, late = moved(recording.grids[0, first], rows, columns), recording.grids[0, first + gap]
        both = (early != UNKNOWN) & (late != UNKNOWN)
        equal += (early[both] == late[both]).sum()
        known += both.sum()
    return equal / known


@pytest.mark.parametrize("yaw_rate_radps", [-0.25, 0.0, 0.25])
def test_grids_of_a_static_world_agree_once_they_are_aligned(tmp_path, yaw_rate_radps):
    world = street(3, yaw_rate_radps=yaw_rate_radps, speed_mps=9.0)
    filtered, plain = built(world, tmp_path), built(world, tmp_path, GridConfig(morphology="off"))
    for gap in (5, 15):
        assert agreement(filtered, gap) >= 0.95
        aligned = agreement(plain, gap)
        assert aligned >= 0.95
        for extra in ((-1, 0), (1, 0), (0, -1), (0, 1)):  # no systematic displacement: every other place is worse
            assert agreement(plain, gap, extra) < aligned - 0.005


@pytest.mark.parametrize("left_m", [-5.0, 5.0])
@pytest.mark.parametrize("pitch_rad", [-0.02, 0.038])
def test_a_pole_seen_through_a_log_lands_where_it_stands(tmp_path, left_m, pitch_rad):
    world = ToyWorld([Box("pole", 20.0, 20.2, left_m - 0.2, left_m + 0.2, 3.0)], frames=3, pitch_rad=pitch_rad)
    recording = built(world, tmp_path, GridConfig(morphology="off"))
    rows, columns = np.nonzero(recording.grids[0, 0] == POLE)
    assert set(rows) == {127 - int(20.0 / CELL_M)}
    assert {63 - int(np.floor(left_m / CELL_M))} <= set(columns)


def test_finer_cells_hold_the_same_points(tmp_path):
    world = street(1, frames=2, speed_mps=9.0)
    for factor in (2, 4):
        cells = 128 * factor
        spec = GridSpec(rows=cells, columns=cells, cell_m=CELL_M / factor, agent_row=cells, agent_column=cells // 2)
        fine = built(world, tmp_path, GridConfig(spec=spec, morphology="off"))
        plain = built(world, tmp_path, GridConfig(morphology="off"))
        known = fine.grids != UNKNOWN
        blocks = known.reshape(*known.shape[:2], 128, factor, 128, factor).any(axis=(3, 5))
        np.testing.assert_array_equal(blocks, plain.grids != UNKNOWN)
        np.testing.assert_array_equal(fine.position_m, plain.position_m)
        assert known.sum() < factor**2 * blocks.sum(), "the same points know less of an area in finer cells"


def test_pixels_near_borders_are_in_no_grid(tmp_path):
    config = GridConfig(sensors={"full": CameraSensor(exclude_border_px=2)}, morphology="off")
    plain, less = (built(street(1, frames=2), tmp_path, each) for each in (GridConfig(morphology="off"), config))
    known, kept = plain.grids[0] != UNKNOWN, less.grids[0] != UNKNOWN
    assert (kept <= known).all()
    assert 0.5 * known.sum() < kept.sum() < known.sum()


def test_sensors_see_their_part_only_and_together_no_more_than_the_whole(tmp_path):
    recording = built(street(1, frames=2), tmp_path, GridConfig(morphology="off"))
    known = {name: recording.grids[i] != UNKNOWN for i, name in enumerate(recording.sensors)}
    assert recording.sensors[0] == "full"
    np.testing.assert_array_equal(known["split1_upper"] | known["split1_lower"], known["full"])
    split2 = known["split2_upper"] | known["split2_lower"]
    assert (split2 <= known["full"]).all()
    assert split2.sum() < 0.9 * known["full"].sum()


def test_grids_are_built_once_and_again_when_the_configuration_changes(tmp_path):
    path = tmp_path / "logs" / "toy.mcap"
    write_log(street(2, frames=3).recording(), path)
    first = build_grids([path], tmp_path / "grids", GridConfig())
    again = build_grids([path], tmp_path / "grids", GridConfig())
    assert (first.built, first.reused, again.built, again.reused) == (1, 0, 0, 1)
    np.testing.assert_array_equal(first.recordings[0].cells("full"), again.recordings[0].cells("full"))
    assert again.recordings[0].sensors == first.recordings[0].sensors
    other = build_grids([path], tmp_path / "grids", GridConfig(morphology="off"))
    assert (other.built, other.reused) == (1, 0)
    assert (other.recordings[0].cells("full") != first.recordings[0].cells("full")).any()


def test_stretches_of_a_long_log_come_back(tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(2, frames=9, yaw_rate_radps=0.2).recording("toy"), path)
    built_first = build_grids([path], tmp_path / "cut", GridConfig(stretch_frames=2)).recordings
    read_again = build_grids([path], tmp_path / "cut", GridConfig(stretch_frames=2)).recordings
    assert [recording.name for recording in read_again] == ["toy#1", "toy#2", "toy#3", "toy#4"]
    for one, same in zip(build_log(path, GridConfig(stretch_frames=2)), read_again, strict=True):
        for name in ("stamps_ns", "position_m", "yaw_rad"):
            np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        for sensor in one.sensors:
            np.testing.assert_array_equal(one.cells(sensor), same.cells(sensor))
    assert len(built_first) == 4


def test_recordings_have_the_sensors_that_are_asked_for(tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(2, frames=2).recording(), path)
    (whole,) = build_grids([path], tmp_path / "grids", GridConfig()).recordings
    for sensors in (["split2_lower", "full"], []):  # built, and then found
        (part,) = build_grids([path], tmp_path / "grids", GridConfig(), sensors=sensors).recordings
        assert set(part.sensors) == {*sensors, "full"}, "the target is always needed"
        for name in part.sensors:
            np.testing.assert_array_equal(part.cells(name), whole.cells(name))


def test_damaged_grids_are_made_anew(tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(2, frames=2).recording(), path)
    first = build_grids([path], tmp_path / "grids", GridConfig())
    kept = next((tmp_path / "grids").iterdir())
    kept.write_bytes(kept.read_bytes()[:500])
    again = build_grids([path], tmp_path / "grids", GridConfig())
    assert again.built == 1
    np.testing.assert_array_equal(first.recordings[0].cells("full"), again.recordings[0].cells("full"))


def test_a_log_that_fails_is_named_and_the_others_go_on(tmp_path):
    good, bad = tmp_path / "good.mcap", tmp_path / "bad.mcap"
    write_log(street(2, frames=2).recording("good"), good)
    bad.write_bytes(good.read_bytes()[:3000])
    data = build_grids([bad, good], tmp_path / "grids", GridConfig(), executor=Processes(2))
    assert [recording.name for recording in data.recordings] == ["good"]
    assert list(data.failed) == [str(bad)]
    assert "bad.mcap" in data.failed[str(bad)]


def test_longer_logs_are_cut_into_stretches_that_begin_straight(tmp_path):
    path = tmp_path / "long.mcap"
    write_log(street(2, frames=7, yaw_rate_radps=0.3).recording("long"), path)
    parts = build_log(path, GridConfig(stretch_frames=3))
    assert [(part.name, len(part.stamps_ns)) for part in parts] == [("long#1", 3), ("long#2", 3)]
    assert parts[1].yaw_rad[0] == 0
    assert (parts[1].position_m[0] == 0).all()


def test_a_camera_that_a_log_lacks_is_named(tmp_path):
    with pytest.raises(LogError, match=r"toy\.mcap: camera: 'rear' is not front, the only choice"):
        built(street(1, frames=1), tmp_path, GridConfig(sensors={"full": CameraSensor(camera="rear")}))


def test_class_map_moves_a_label_to_another_class(tmp_path):
    plain = built(street(1, frames=1), tmp_path)
    changed = built(street(1, frames=1), tmp_path, GridConfig(class_map={"terrain": None, "sidewalk": "road"}))
    assert CLASS_NAMES.index("sidewalk") in plain.grids
    assert CLASS_NAMES.index("sidewalk") not in changed.grids
    assert CLASS_NAMES.index("vegetation") not in changed.grids


def test_motion_that_no_vehicle_has_gives_no_grids(tmp_path, monkeypatch):
    monkeypatch.setattr("semgrid_eval.log.writer.implausible", lambda sample: None)  # as another writer would
    with pytest.raises(LogError, match=r"toy\.mcap: /ego/motion at \d+ ns: speed_mps: 1e\+06 m/s is not within"):
        built(street(1, frames=2, speed_mps=1e6), tmp_path)


def test_grids_with_a_flipped_bit_are_made_again_alike_and_a_line_says_so(tmp_path, caplog):
    log = tmp_path / "log.mcap"
    write_log(street(1, frames=3).recording(), log)
    build_grids([log], tmp_path / "grids", GridConfig())
    (kept,) = (tmp_path / "grids").glob("*.npz")
    whole, rng = kept.read_bytes(), np.random.default_rng(0)
    for made, at in enumerate(rng.integers(len(whole), size=5), start=1):
        content = bytearray(whole)
        content[at] ^= 1 << rng.integers(8)
        kept.write_bytes(content)
        assert build_grids([log], tmp_path / "grids", GridConfig()).built == 1
        assert kept.read_bytes() == whole
        assert len([text for text in caplog.messages if "the grids are made again" in text]) == made
