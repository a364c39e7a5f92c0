"""Bags that are cut off, changed or incomplete on the disk: one line, or all that there is."""

import struct

import numpy as np
import pytest
from support.bad_bags import MESSAGES, TEXT, fault
from support.bags import write_bag

from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
def test_a_bag_that_is_cut_off(tmp_path, storage, share):
    write_bag(tmp_path / "drive", MESSAGES, storage)
    (file,) = (path for path in (tmp_path / "drive").iterdir() if path.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    for bag in ("drive", f"drive/{file.name}"):
        line = fault(tmp_path, bag=bag)
        assert line.startswith(f"{bag}: is damaged or not a bag: ")
        if share:
            assert "it was cut off while it was recorded or copied: recover it" in line


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_flipped_bytes_are_one_line_or_seen_nowhere(tmp_path, storage):
    write_bag(tmp_path / "drive", MESSAGES, storage)
    (file,) = (path for path in (tmp_path / "drive").iterdir() if path.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    (tmp_path / "map.yaml").write_text(TEXT)
    rng = np.random.default_rng(1)
    for _ in range(12):
        broken = bytearray(data)
        for place in rng.integers(0, len(data), 40):
            broken[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(broken)
        summary = convert_bags(
            Ros2Options(bag=(tmp_path / "drive",), map=str(tmp_path / "map.yaml")), tmp_path / "logs"
        )
        assert all("\n" not in line for line in summary.failed.values())


def without_index(data):
    """Return an MCAP file whose footer names no summary."""
    footer = data[:-37] + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + data[-8:]
    start = struct.unpack("<Q", data[-28:-20])[0]
    return footer[:start] + footer[-37:]


def test_an_mcap_file_without_index_is_read_whole(tmp_path):
    write_bag(tmp_path / "drive", MESSAGES)
    file = tmp_path / "drive" / "drive.mcap"
    (tmp_path / "map.yaml").write_text(TEXT)
    options = Ros2Options(bag=(file,), map=str(tmp_path / "map.yaml"))
    assert convert_bags(options, tmp_path / "logs").written == ["val/drive_000000"]
    file.write_bytes(without_index(file.read_bytes()))
    assert convert_bags(options, tmp_path / "again").written == ["val/drive_000000"]
    logs = [folder / "val" / "drive_000000.mcap" for folder in (tmp_path / "logs", tmp_path / "again")]
    assert logs[0].read_bytes() == logs[1].read_bytes()


def test_a_folder_without_metadata(tmp_path):
    write_bag(tmp_path / "drive", MESSAGES)
    (tmp_path / "drive" / "metadata.yaml").unlink()
    line = fault(tmp_path)
    assert line == "drive: has no metadata.yaml; name its .mcap or .db3 files instead, or run: ros2 bag reindex"


def test_a_file_of_another_kind(tmp_path):
    (tmp_path / "drive.txt").write_text("hello")
    assert "Unrecognized storage format" in fault(tmp_path, bag="drive.txt")
