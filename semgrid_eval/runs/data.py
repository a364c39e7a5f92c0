"""The grids that a matrix needs: built once for each grid configuration, split into training and validation."""

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import torch

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.executors import Executor
from semgrid_eval.files import digest_value
from semgrid_eval.grids.build import GridDataSet, build_grids
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.fingerprint import kept_fingerprints
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.progress import Progress, Stage
from semgrid_eval.runs.row import Row
from semgrid_eval.scores.results import LogRecord
from semgrid_eval.sensors.kinds import misfit
from semgrid_eval.sources.benchmarks import published_fingerprints
from semgrid_eval.windows.grids import GridData, stack_recordings
from semgrid_eval.windows.storage import Storage


class GridSource(Protocol):
    """Where a run's grids come from, and what is known of their logs."""

    @property
    def cache(self) -> Path | None:
        """Folder of what is worked out of the logs once and kept; None where there are no logs."""

    failed: dict[str, str]  # reasons, by the paths of logs that gave no grids
    records: dict[str, LogRecord]  # by the paths of logs
    log_of: dict[str, str]  # path of the log, by name of the recording

    def prepare(self) -> None:
        """Make all grids that are needed."""

    def identify(self) -> None:
        """Fingerprint the logs of benchmarks."""

    def data(self, config: GridConfig, split: str) -> GridData:
        """Return the grids of all recordings of one split."""


class RunData:
    """Grids of a folder of logs, made when a row first asks for them, kept in the folder `cache` and put on `device`.

    On a CPU what windows are taken from is a file there that is mapped into memory. `rows` are all rows of the matrix:
    they tell which sensors and splits are needed.
    """

    def __init__(
        self, logs: Path, cache: Path, rows: Sequence[Row], *, executor: Executor, device: torch.device, stage: Stage
    ) -> None:
        self._folder = logs
        self._logs = find_logs(logs)
        self.cache, self._executor, self._stage = cache, executor, stage
        self._storage = Storage(device, cache, stage)
        self._configs = {grid_digest(row.grid): row.grid for row in rows}
        self._sensors, self._splits = defaultdict[str, list[str]](list), defaultdict[str, set[str]](set)
        for row in rows:
            key = grid_digest(row.grid)
            self._sensors[key].extend(row.sensors)
            self._splits[key].update(row.splits)
        self._sets: dict[str, GridDataSet] = {}
        self._stacked: dict[tuple[str, str], GridData] = {}
        self.failed: dict[str, str] = {}
        self.records: dict[str, LogRecord] = {}
        self.log_of: dict[str, str] = {}  # path below the folder of logs, by name of the recording

    def prepare(self) -> None:
        """Build all grids of the matrix now, as many logs at once as the executor works on."""
        for config in self._configs.values():
            self.grids(config)

    def identify(self) -> None:
        """Fingerprint the logs of benchmarks, so that a report can compare them with the published ones."""
        records = [record for record in self.records.values() if published_fingerprints(record.dataset)]
        if records:
            logs = {record.digest: self._folder / record.path for record in records}
            with self._stage("compare") as progress:
                found = kept_fingerprints(logs, self.cache, executor=self._executor, progress=progress)
            for record in records:
                known = record.model_copy(update={"fingerprint": found.get(record.digest)})
                self.records[record.path] = known

    def data(self, config: GridConfig, split: str) -> GridData:
        """Return the grids of all recordings of one split.

        Raises:
            InputError: there is no recording of that split.
        """
        key = (grid_digest(config), split)
        if key not in self._stacked:
            data_set = self.grids(config)
            chosen = [recording for recording in data_set.recordings if recording.split == split]
            if not chosen:
                raise InputError(self._why_none(data_set, split))
            self._stacked[key] = stack_recordings(
                chosen,
                cell_m=config.spec.cell_m,
                classes=config.classes,
                sensors=list(dict.fromkeys(self._sensors[key[0]])),
                storage=self._storage,
            )
        return self._stacked[key]

    def grids(self, config: GridConfig) -> GridDataSet:
        """Return the grids of all recordings of which some row asks for them, on disk."""
        key = grid_digest(config)
        if key in self._sets:
            return self._sets[key]
        with self._stage("grids") as progress:
            if misfits := self._misfits(config, progress):
                self._sets[key] = GridDataSet(failed=misfits)  # which is the rows' fault: no log is to be told of
                return self._sets[key]
            self._sets[key] = build_grids(
                self._logs,
                self.cache,
                config,
                sensors=self._sensors[key],
                splits=self._splits[key],
                executor=self._executor,
                progress=progress,
            )
        self._note(self._sets[key])
        return self._sets[key]

    def _note(self, data_set: GridDataSet) -> None:
        """Note which logs gave grids, and why others failed."""
        for log, reason in data_set.failed.items():
            path = str(Path(log).relative_to(self._folder))
            self.failed[path] = reason.replace(log, path)
        for recording in data_set.recordings:
            path = str(Path(recording.log).relative_to(self._folder))
            other = self.log_of.setdefault(recording.name, path)
            if other != path:
                raise InputError(f"{path} and {other} both hold {recording.name}", path=self._folder)
            if path in self.records:  # by another configuration of grids
                continue
            self.records[path] = LogRecord(
                name=Path(recording.log).stem,
                path=path,
                digest=recording.digest,
                split=recording.split,
                dataset=recording.dataset,
                group=recording.group,
                checksums=recording.has_checksums,
                recovered=recording.recovered,
            )

    def _misfits(self, config: GridConfig, progress: Progress) -> dict[str, str]:
        """Say of each log why it cannot have what a grid's sensors look at; nothing where one may, or is damaged."""
        found = {}
        for done, log in enumerate(self._logs, start=1):
            fault = None
            with suppress(LogError), LogReader(log) as reader:
                fault = misfit(reader, config.sensors.values())
            if fault is None:
                return {}
            found[str(log)] = fault
            progress(done, len(self._logs), log.stem)
        return found

    def _why_none(self, data_set: GridDataSet, split: str) -> str:
        """Say why there are no grids of a split: of the reasons for which all logs failed, the first."""
        known = data_set.splits
        if data_set.failed and not data_set.recordings and (split in known or not known):
            log, reason = min(data_set.failed.items())
            first = reason.replace(log, str(Path(log).relative_to(self._folder)))
            return f"none of the logs ({len(data_set.failed)}) gave grids; the first fails by: {first}"
        found = ", ".join(sorted(known))
        return f"no recording of split {split!r} gave grids (splits found: {found})"


def grid_digest(config: GridConfig) -> str:
    """Digest what determines the grids of a configuration."""
    return digest_value(config.identity())
