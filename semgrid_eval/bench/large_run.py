"""A run of many rows, repeats and windows, made from nothing, whose report is measured."""

from pathlib import Path

import numpy as np

from semgrid_eval.files import digest_value
from semgrid_eval.grids.spec import MOVING, STANDING, GridSpec
from semgrid_eval.scores import results
from semgrid_eval.scores.facts import RowFacts
from semgrid_eval.scores.metrics.metric import ScoredWindows
from semgrid_eval.scores.metrics.table import Sums, count_windows
from semgrid_eval.scores.sums import write_sums

CLASSES = 10
SPEC = GridSpec(rows=32, columns=32, agent_row=32, agent_column=16)
WRONG = 0.2
FRAME_NS = 58_823_529


def make_run(run: Path, rows: int, repeats: int, windows: int) -> None:
    """Write a run of trained rows whose every window is a recording of its own; it keeps no pictures."""
    records = tuple(_window(i) for i in range(windows))
    generator = np.random.default_rng(0)
    base = count_windows(_scored(generator, windows))
    found = tuple(_row(run, number, repeats, records, base, generator) for number in range(rows))
    logs = tuple(
        results.LogRecord(name=w.log, path=w.log, digest=digest_value(w.log), split="val", dataset="none")
        for w in records
    )
    record = results.RunRecord(
        format_version=results.FORMAT_VERSION,
        title="Large",
        command="",
        matrix={},
        versions={},
        machine={},
        started="2026-01-01T00:00:00Z",
        seconds=0.0,
        logs=logs,
        failed_logs={},
        rows=found,
    )
    results.write_run(run, record)


def _row(
    run: Path,
    number: int,
    repeats: int,
    windows: tuple[results.WindowRecord, ...],
    base: Sums,
    generator: np.random.Generator,
) -> results.RowRecord:
    facts = RowFacts(
        model="newest" if number == 0 else "ed",
        family="BL" if number == 0 else "ED",
        learns=number > 0,
        baseline=number == 0,
        inputs=2,
        step_frames=5,
        horizon_steps=1,
        sensors=("full",),
        translate=True,
    )
    ids = []
    for seed in range(repeats):
        result_id = digest_value([number, seed])
        folder = results.result_folder(run, result_id)
        # Windows in another order and a little thinned out are as good as new predictions.
        order, kept = generator.permutation(len(windows)), generator.uniform(0.9, 1.0)
        write_sums(folder, {key: (sums[order] * kept).astype(np.int32) for key, sums in base.items()})
        results.write_result(folder, _result(result_id, seed, facts, windows))
        ids.append(result_id)
    name = "BL-DC" if number == 0 else f"ED-{number}"
    return results.RowRecord(facts=facts, name=name, label=name, results=tuple(ids))


def _result(
    result_id: str, seed: int, facts: RowFacts, windows: tuple[results.WindowRecord, ...]
) -> results.ResultRecord:
    return results.ResultRecord(
        format_version=results.FORMAT_VERSION,
        id=result_id,
        facts=facts,
        targets="large",
        lead_s=0.3,
        config={"model": facts.model},
        log_digests=(),
        seed=seed,
        windows_id="large",
        windows=windows,
        device="cpu",
        train_seconds=1.0,
        predict_seconds=1.0,
        parameters=1,
    )


def _window(number: int) -> results.WindowRecord:
    name = f"drive_{number:03d}"
    stamps_ns = (10 * FRAME_NS, 15 * FRAME_NS)
    return results.WindowRecord(
        recording=name, log=f"{name}.mcap", target_frame=20, target_stamp_ns=20 * FRAME_NS, input_stamps_ns=stamps_ns
    )


def _scored(generator: np.random.Generator, windows: int) -> ScoredWindows:
    shape = (windows, SPEC.rows, SPEC.columns)
    target = generator.integers(0, CLASSES, shape).astype(np.uint8)
    other = generator.integers(0, CLASSES, shape).astype(np.uint8)
    return ScoredWindows(
        target=target,
        prediction=np.where(generator.random(shape) < WRONG, other, target),
        certainty=generator.integers(0, 256, shape).astype(np.uint8),
        left_out=generator.random(shape) < 0.1,
        inputs=generator.integers(0, 2, (windows, 1, 2, *shape[1:])).astype(np.uint8),
        actors=generator.choice(np.array([0, STANDING, MOVING], np.uint8), shape),
        spec=SPEC,
    )
