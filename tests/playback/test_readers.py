"""A played log read with nothing but what it brings along: no module of ours, no generated message."""

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from PIL import Image
from support.small_runs import run, write_logs

from semgrid_eval.classes import DEFAULT_CLASSES
from semgrid_eval.playback.write import Play, write_playback


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    """All messages of a log of two rows by topic, decoded by the schemas in it."""
    folder = tmp_path_factory.mktemp("readers")
    rows = [
        {"name": "newest", "model": "newest"},
        {"name": "overlay", "model": "overlay", "sensors": ["split2_upper", "split2_lower"]},
    ]
    run(rows, write_logs(folder / "logs"), folder / "run")
    log = write_playback(Play(folder / "run", ("newest", "overlay"), folder / "logs"), folder / "play.mcap").log
    found, types = {}, {}
    with log.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if schema.name not in types:
                types[schema.name] = type_of(schema)
            found.setdefault(channel.topic, []).append(types[schema.name].FromString(message.data))
    return found


def type_of(schema):
    assert schema.encoding == "protobuf"
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))


@pytest.mark.parametrize("topic", ["/grid/target", "/grid/prediction/1", "/grid/prediction/2", "/grid/input/1/1"])
def test_viewers_pictures_and_programs_are_told_the_same_grid(messages, topic, tmp_path):
    forms = (messages[f"{topic}{form}"] for form in ("", "/picture", "/exact"))
    masks = messages["/grid/mask/1"]
    for grid, picture, exact, mask in zip(*forms, masks, strict=True):
        ids = np.frombuffer(exact.class_ids, np.uint8).reshape(exact.rows, exact.columns)
        fields = [field.name for field in grid.fields]
        assert fields == ["red", "green", "blue", "alpha", "class_id"]
        # Columns go along x and rows along y, from the right end nearest to the vehicle.
        cells = np.frombuffer(grid.data, np.uint8).reshape(-1, grid.column_count, grid.cell_stride)
        shown = cells.transpose(1, 0, 2)[::-1, ::-1]
        np.testing.assert_array_equal(shown[..., 4], ids)
        expected = DEFAULT_CLASSES.palette()[ids]
        np.testing.assert_array_equal(shown[..., :3][ids > 0], expected[ids > 0])
        np.testing.assert_array_equal(shown[..., 3], np.where(ids, 255, 0))
        if topic == "/grid/target":
            left_out = np.frombuffer(mask.data, np.uint8).reshape(-1, mask.column_count, mask.cell_stride)[..., 4]
            expected[left_out.T[::-1, ::-1] > 0] = 255
        (tmp_path / "grid.png").write_bytes(picture.data)
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "grid.png").convert("RGB")), expected)
        times = {(each.timestamp.seconds, each.timestamp.nanos) for each in (grid, exact, picture)}
        assert len(times) == 1
        assert grid.frame_id == exact.frame_id == picture.frame_id == "grid"
