"""Grids without their logs, in a folder that can be carried to another machine and run there in the logs' place.

```
FOLDER/packed.json           how the grids were made, and the record of each log
FOLDER/<path of a log>.npz   its recordings, as grids are always kept, sealed by the log's digest
```
"""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.grids.recording import KeptRecording, find_recordings, write_recordings
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.runs.data import RunData, grid_digest
from semgrid_eval.runs.row import Row
from semgrid_eval.scores.results import LogRecord
from semgrid_eval.seals import read_sealed_json, write_sealed_json
from semgrid_eval.windows.grids import GridData, stack_recordings
from semgrid_eval.windows.storage import Storage

INDEX_FILE = "packed.json"
_INDEX = "packed"  # owns the index, which has no id


class PackedIndex(Config):
    """What a folder of packed grids says of itself."""

    grid: GridConfig
    logs: tuple[LogRecord, ...]


def pack_grids(data: RunData, config: GridConfig, folder: Path) -> None:
    """Write the grids of all logs, of the sensors that the data's rows need, with what is known of their logs."""
    data.prepare()
    data.identify()
    found = groupby(data.grids(config).recordings, key=lambda recording: data.log_of[recording.name])
    for log, recordings in found:
        write_recordings(_file(folder, log), list(recordings), owner=data.records[log].digest)
    write_index(folder, PackedIndex(grid=config, logs=tuple(data.records.values())))


def write_index(folder: Path, index: PackedIndex) -> None:
    """Write what a folder of packed grids says of itself."""
    write_sealed_json(folder / INDEX_FILE, index.model_dump(mode="json"), _INDEX)


def is_packed(folder: Path) -> bool:
    """Tell whether a folder holds packed grids."""
    return (folder / INDEX_FILE).is_file()


class PackedGrids:
    """Packed grids in a storage, in place of `RunData`; `rows` tell which sensors are needed.

    Raises:
        InputError: the folder is damaged.
    """

    def __init__(self, folder: Path, rows: Sequence[Row], storage: Storage) -> None:
        self._folder, self._storage = folder, storage
        self.cache = None
        index = folder / INDEX_FILE
        self._index = parse_config(PackedIndex, read_sealed_json(index, _INDEX), path=index)
        self._sensors = list(dict.fromkeys(sensor for row in rows for sensor in row.sensors))
        self._stacked: dict[str, GridData] = {}
        self.failed: dict[str, str] = {}
        self.records = {log.path: log for log in self._index.logs}
        self.log_of: dict[str, str] = {}

    def prepare(self) -> None:
        """Do nothing: the grids are made."""

    def identify(self) -> None:
        """Do nothing: fingerprints are packed with the grids."""

    def data(self, config: GridConfig, split: str) -> GridData:
        """Return the grids of all recordings of one split.

        Raises:
            InputError: there is none of that split, or grids of this configuration are not what is packed.
        """
        if grid_digest(config) != grid_digest(self._index.grid):
            raise InputError("holds grids that were made in another way than this row's", path=self._folder)
        if split not in self._stacked:
            recordings = [each for log in self._index.logs if log.split == split for each in self._find(log)]
            if not recordings:
                raise InputError(f"holds no recording of split {split!r}", path=self._folder)
            self._stacked[split] = stack_recordings(
                recordings,
                cell_m=config.spec.cell_m,
                classes=config.classes,
                sensors=self._sensors,
                storage=self._storage,
            )
        return self._stacked[split]

    def _find(self, log: LogRecord) -> list[KeptRecording]:
        file = _file(self._folder, log.path)
        found = find_recordings(file, self._folder / log.path, owner=log.digest)
        if other := {recording.digest for recording in found} - {log.digest}:
            raise ResultError(f"holds the log {', '.join(other)}, not {log.digest}", path=file)
        self.log_of |= {recording.name: log.path for recording in found}
        return found


def _file(folder: Path, log: str) -> Path:
    return (folder / log).with_suffix(".npz")
