"""A plausible run folder, made in a second or two from nothing: streets, shifted inputs and imperfect predictors."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from support.fake_scenes import ID, SIDE, Grid, scene, seen_from

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_COUNT, UNKNOWN
from semgrid_eval.files import digest_value
from semgrid_eval.grids.spec import MOVING, STANDING, GridSpec
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores import results
from semgrid_eval.scores.metrics.metric import ScoredWindows
from semgrid_eval.scores.metrics.table import count_windows
from semgrid_eval.scores.sums import write_sums
from semgrid_eval.seals import open_seal, write_sealed

FRAME_NS = 58_823_529

HOSTILE = ("<script>alert(1)</script>", "\"quoted\" & 'more'", "{{ 7 * 7 }} $x_1$ \\frac", "n" * 10_000)
"""Names that must be shown as text, wherever they come from."""


@dataclass(frozen=True)
class FakeRow:
    what: str
    family: str
    wrong: float = 0.0  # share of wrongly predicted cells of a trained model
    seeds: int = 0  # 0: the predictor does not depend on chance
    sensors: tuple[str, ...] = ("front",)
    translate: bool = True
    horizon_steps: int = 1
    failure: str | None = None
    inputs: int = 2  # on record; there are two
    baseline: bool | None = None  # `BL` are, if not said otherwise
    learns: bool | None = None  # what is not a baseline does, if not said otherwise
    cell_m: float = 0.78125  # of a grid with other cells, other targets
    disturbed: str = ""  # what is wrong with its inputs; on record
    bound: str = ""  # `upper` and `told` rows are told of the truth
    same_as: str = ""  # the row whose results it has, by another name

    @property
    def name(self) -> str:
        return f"{self.family}-{self.what}"

    @property
    def words(self) -> str:
        return "model-driven baseline" if self.facts.baseline else "network"

    @property
    def facts(self) -> results.RowFacts:
        found = facts(self.family, self.sensors, self.horizon_steps, translate=self.translate)
        baseline = found.baseline if self.baseline is None else self.baseline
        model = {"BL-Fuse": "fuse", "BL-DC": "newest", "BL-NT": "newest"}.get(self.name, self.family.lower())
        learns = not baseline if self.learns is None else self.learns
        changes = {"baseline": baseline, "learns": learns, "model": model, "inputs": self.inputs}
        changes["disturbed"] = self.disturbed
        changes |= {"bound": self.bound.removeprefix("told"), "uses_truth": self.bound in ("upper", "told")}
        return found.model_copy(update=changes)

    @property
    def config(self) -> dict[str, object]:
        config: dict[str, object] = {"model": self.facts.model, "sensors": list(self.sensors)}
        config |= {"translate": self.translate, "window": {"horizon_steps": self.horizon_steps, "inputs": self.inputs}}
        config |= {"grid": {"cell_m": self.cell_m}, "settings": {"depth": 3} if self.seeds else {}}
        config |= {"disturb": {"kind": self.disturbed}} if self.disturbed else {}
        return config


ROWS = (
    FakeRow("DC", "BL"),
    FakeRow("NT", "BL", translate=False),
    FakeRow("Fuse", "BL"),
    FakeRow("DC", "ED", wrong=0.06, seeds=3),
    FakeRow("Sp2", "BL", sensors=("lower", "upper")),
    FakeRow("Sp2", "ED", wrong=0.10, seeds=2, sensors=("lower", "upper")),
    FakeRow("NT", "ED", translate=False, failure="the loss became not a number in epoch 3"),
)


def _on_parts(what: str, sensors: tuple[str, ...]) -> tuple[FakeRow, ...]:
    return FakeRow(what, "BL", sensors=sensors), FakeRow(what, "ED", 0.15, 1, sensors=sensors)


_SPLIT = ("split2_upper", "split2_lower")
REFERENCE_ROWS = (
    *(FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.10, 1)),
    *(FakeRow("NT", "BL", translate=False), FakeRow("NT", "ED", 0.20, 1, translate=False)),
    *(row for at in (1, 2) for row in _on_parts(f"Sp{at}", (f"split{at}_upper", f"split{at}_lower"))),
    FakeRow("SL2", "ED", 0.10, 1, same_as="ED-DC"),
    *(FakeRow(f"SL{inputs}", "ED", 0.10 - inputs / 100, 1, inputs=inputs) for inputs in (3, 4, 5)),
    *(FakeRow(f"PH{at}", "BL", horizon_steps=at + 1) for at in (1, 2, 3)),
    *(FakeRow(f"PH{at}", "ED", 0.10 + at / 20, 1, horizon_steps=at + 1) for at in (1, 2, 3)),
    *(FakeRow("DC", "RN", 0.08, 1), FakeRow("NT", "RN", 0.18, 1, translate=False)),
    *(FakeRow("Sp2", "RN", 0.12, 1, sensors=_SPLIT), FakeRow("PH3", "RN", 0.2, 1, horizon_steps=4)),
    *(FakeRow("Fuse", "BL"), FakeRow("Fuse-SL5", "BL", inputs=5)),
    *(FakeRow("Table", "BL", learns=True), FakeRow("Flow", "BL")),
    *(FakeRow(f"PH{at}", "ceiling", 0.01, bound="upper", learns=False, horizon_steps=at + 1) for at in range(4)),
    FakeRow("SL5", "ceiling", 0.01, bound="upper", learns=False, inputs=5),
    *(FakeRow(name, "truth", 0.02, bound="told", learns=False) for name in ("fresh", "motion")),
    FakeRow("SL5", "RN", 0.01, 1, inputs=5),
)
"""As many rows as the preset `reference` has, of the same kinds."""


def make_fake_run(
    run: Path,
    *,
    rows: tuple[FakeRow, ...] = ROWS,
    recordings: int = 8,
    windows: int = 2,
    title: str = "Town, small",
    prefix: str = "town",
    truth: bool = True,
) -> Path:
    """Write a run with `windows` windows for each of `recordings` recordings and return its folder.

    With `truth`, results hold the counts near moving and near standing cars apart.
    """
    made = _Maker(run, [f"{prefix}_{i:03d}" for i in range(recordings)], windows, truth)
    records = tuple(made.row(row) for row in rows)
    logs = tuple(
        results.LogRecord(name=n, path=_log(n), digest=digest_value(n), split="val", dataset="synthetic")
        for n in made.names
    )
    results.write_run(
        run,
        results.RunRecord(
            format_version=results.FORMAT_VERSION,
            title=title,
            command="semgrid-eval run smoke --logs logs --out run",
            matrix={"rows": [row.name for row in rows], "training": {"epochs": 6, "batch": 8}},
            versions={"semgrid-eval": "0.1.0", "python": "3.11.2", "torch": "2.13.0"},
            machine={"cpu": "two shared cores", "memory": "8 GiB", "system": "Linux"},
            started="2026-01-02T03:04:05Z",
            seconds=312.5,
            logs=logs,
            failed_logs={f"logs/{prefix}_broken.mcap": "the index is missing"},
            rows=records,
        ),
    )
    return run


def counted_row(
    name: str,
    hits: dict[str, list[int]],
    *,
    near: dict[str, dict[str, list[int]]] | None = None,
    window_ms: float = 10.0,
    cells: int = 100,
) -> Row:
    """Make a row of one window a recording whose IoU of a class is `hits / cells` in each, misses being unknown.

    `near` gives the hits in regions alike.
    """
    counts = _hit_counts(hits, cells)
    windows = tuple(
        results.WindowRecord(
            recording=f"town_{i}", log=_log(f"town_{i}"), target_frame=20, target_stamp_ns=i, input_stamps_ns=(i - 1,)
        )
        for i in range(len(counts))
    )
    record = results.ResultRecord(
        format_version=results.FORMAT_VERSION,
        id=digest_value(name),
        facts=facts(name.split("-", 1)[0]),
        targets="targets",
        lead_s=0.294118,
        config={},
        log_digests=(),
        seed=None,
        windows_id="",
        windows=windows,
        device="cpu",
        train_seconds=None,
        predict_seconds=window_ms * len(windows) / 1000,
        parameters=None,
    )
    row = results.RowRecord(facts=record.facts, name=name, label=name)
    sums = {("iou", "all"): counts[:, None]}
    if near:
        sums["iou", "actors"] = np.stack([_hit_counts(near[region], cells) for region in ("moving", "standing")], 1)
    return Row(name, row, (Result(record, reader(sums), None, Path()),), (), Path())


def reader(sums: dict[tuple[str, str], NDArray[np.int32]]) -> Callable[[str, str], NDArray | None]:
    """Let a result have its sums in memory."""
    return lambda metric, partition: sums.get((metric, partition))


def with_counts(result: Result, counts: NDArray[np.integer], **changes: object) -> Result:
    """Give a result other confusion counts (N, C, C) of all cells, and its record other fields."""
    record = result.record.model_copy(update=changes)
    return replace(result, read=reader({("iou", "all"): np.asarray(counts, np.int32)[:, None]}), record=record)


def facts(
    family: str, sensors: tuple[str, ...] = ("front",), horizon_steps: int = 1, *, translate: bool = True
) -> results.RowFacts:
    """What a row of a family is: `BL` are baselines, all others learn."""
    return results.RowFacts(
        model=family.lower(),
        family=family,
        learns=family != "BL",
        baseline=family == "BL",
        inputs=2,
        step_frames=5,
        horizon_steps=horizon_steps,
        sensors=sensors,
        translate=translate,
    )


def _hit_counts(hits: dict[str, list[int]], cells: int) -> NDArray[np.int32]:
    counts = np.zeros((len(next(iter(hits.values()))), CLASS_COUNT, CLASS_COUNT), np.int32)
    for name, numbers in hits.items():
        counts[:, ID[name], ID[name]] = numbers
        counts[:, ID[name], UNKNOWN] = cells - np.array(numbers)
    return counts


class _Maker:
    def __init__(self, run: Path, names: list[str], windows: int, truth: bool) -> None:
        self.run, self.names = run, names
        self.records = tuple(
            results.WindowRecord(
                recording=n,
                log=_log(n),
                target_frame=20 + k,
                target_stamp_ns=(20 + k) * FRAME_NS,
                input_stamps_ns=((10 + k) * FRAME_NS, (15 + k) * FRAME_NS),
            )
            for n in names
            for k in range(windows)
        )
        scenes = [scene(np.random.default_rng([7, i]), k) for i in range(len(names)) for k in range(windows)]
        self.past = np.array([s[0] for s in scenes], np.uint8).reshape(-1, 2, SIDE, SIDE)
        self.target = np.array([s[1] for s in scenes], np.uint8).reshape(-1, SIDE, SIDE)
        self.truth = np.array([s[2] for s in scenes], np.uint8).reshape(-1, SIDE, SIDE)
        near = np.array([s[3] for s in scenes], bool).reshape(-1, 2, SIDE, SIDE)
        flags = near[:, 0] * MOVING + near[:, 1] * STANDING
        self.actors = flags.astype(np.uint8) if truth else None
        self.mask = (self.past != UNKNOWN).any(1) & (self.target == UNKNOWN)

    def row(self, row: FakeRow) -> results.RowRecord:
        ids: tuple[str, ...] = ()
        if row.failure is None:
            inputs = self._inputs(row)
            windows_id = digest_value([row.what, len(self.records), self.names])
            arrays = {"inputs": inputs, "target": self.target, "mask": self.mask}
            write_arrays(results.windows_file(self.run, windows_id), arrays, owner=windows_id)
            ids = tuple(self._result(row, seed, inputs, windows_id) for seed in range(max(1, row.seeds)))
        return results.RowRecord(
            facts=row.facts,
            name=row.name,
            label=f"{row.name} ({row.words}, 2 inputs)",
            words=row.words,
            results=ids,
            failure=row.failure,
        )

    def _inputs(self, row: FakeRow) -> Grid:
        past = self.past if row.translate else np.roll(self.past, (-6, -3), axis=(2, 3))
        if len(row.sensors) == 1:
            return past[:, None]
        rows = np.arange(SIDE)[:, None]
        near, far = np.where(rows > 78, past, UNKNOWN), np.where(rows < 64, past, UNKNOWN)
        return np.stack([near, far], axis=1).astype(np.uint8)

    def _predict(self, row: FakeRow, seed: int, inputs: Grid) -> tuple[Grid, Grid]:
        newest = inputs[:, :, -1].max(axis=1)
        if not row.facts.baseline:
            return _guess(np.random.default_rng([11, seed, len(row.what)]), row, self.truth)
        older = inputs[:, :, 0].max(axis=1)
        fused = np.where(newest == UNKNOWN, older, newest) if row.what == "Fuse" else newest
        return fused, np.full_like(fused, 255)

    def _result(self, row: FakeRow, seed: int, inputs: Grid, windows_id: str) -> str:
        prediction, certainty = self._predict(row, seed, inputs)
        trained = row.seeds > 0
        result_id = digest_value([row.same_as or row.name, row.wrong, row.config, seed, self.names])
        folder = results.result_folder(self.run, result_id)
        arrays = {"prediction": prediction, "certainty": certainty}
        write_arrays(folder / "predictions.npz", arrays, owner=result_id)
        scored = ScoredWindows(self.target, prediction, certainty, self.mask, inputs, self.actors, GridSpec())
        write_sums(folder, count_windows(scored))
        if trained:
            write_sealed(folder / "history.csv", f"{_history(seed, row.wrong)}# {open_seal(result_id)}\n".encode())
        record = results.ResultRecord(
            format_version=results.FORMAT_VERSION,
            id=result_id,
            facts=row.facts,
            targets=digest_value([self.names, len(self.records), row.cell_m]),
            lead_s=0.294118 * row.horizon_steps,
            config=row.config,
            log_digests=tuple(digest_value(n) for n in self.names),
            seed=seed if trained else None,
            windows_id=windows_id,
            windows=self.records,
            device="cpu",
            train_seconds=80.0 + seed if trained else None,
            predict_seconds=1.25,
            parameters=480_000 if trained else None,
        )
        results.write_result(folder, record)
        return result_id


def _history(seed: int, wrong: float) -> str:
    lines = ["epoch,updates,learning_rate,loss,validation_loss,seconds"]
    for epoch in range(1, 7):
        loss = wrong + 1.5 * 0.6**epoch + 0.01 * seed
        lines.append(f"{epoch},{epoch * 50},{1e-3 if epoch < 5 else 1e-4},{loss:.4f},{loss * 1.08:.4f},{13.0}")
    return "\n".join(lines) + "\n"


def _log(name: str) -> str:
    return f"val/{name}.mcap"


def _guess(rng: np.random.Generator, row: FakeRow, truth: Grid) -> tuple[Grid, Grid]:
    """A network that saw the truth through a wide view and got a share of it wrong, in blocks."""
    view = np.array([seen_from(rng, 0) for _ in truth], bool).reshape(truth.shape)
    half = (len(truth), SIDE // 2, SIDE // 2)
    blocks = np.kron(rng.random(half) < row.wrong, np.ones((1, 2, 2), bool))
    guessed = np.where(blocks, np.roll(truth, 9, axis=2), truth)
    prediction = np.where(view, guessed, UNKNOWN).astype(np.uint8)
    return prediction, np.where(blocks, 130, 240).astype(np.uint8)
