"""Print the table of docs/remedies.md: scores of rows on different grids, what is known of their targets, and the cost.

The way is that from BL-DC to the ceiling on the same grid, by the mean. Areas are those of the targets, as shares of
the first row's. The cost is the processor time that one frame's grid takes on this machine, decoding included:
the least of some logs, which are built again.

Example: python tools/remedies_table.py build/remedies/run build/logs/val
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.store import find_logs
from semgrid_eval.report.estimates.bootstrap import Resampling, score_everywhere
from semgrid_eval.report.estimates.way import ways
from semgrid_eval.report.rows.load import Row, load_runs
from semgrid_eval.report.rows.pairing import HEADLINE
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU

COLUMNS = {
    "static_known": "static (known)",
    "small_static": "small static",
    "vehicles": "vehicles",
    "small_dynamic": "small dynamic",
    "mean_known": "mean (known)",
}
LOGS = 3


def lines(rows: Sequence[Row], logs: Sequence[Path]) -> Iterator[str]:
    """Make the table in Markdown, line by line."""
    names = COLUMNS.values()
    head = ["row", *names, "way to the ceiling", *(f"area {name}" for name in names), "ms a frame"]
    yield "| " + " | ".join(head) + " |"
    yield "|---|" + "---|" * (len(head) - 1)
    plain, costs, way = areas_m2(rows[0]), dict[str, float](), shares_of_way(rows)
    for row in rows:
        grid = grid_of(row)
        cost_ms = costs.setdefault(grid.model_dump_json(), -1.0)
        if cost_ms < 0:
            cost_ms = costs[grid.model_dump_json()] = frame_ms(grid, logs)
        scores = IOU.means(class_iou(row.results[0].counts.sum(axis=0)))
        values = [f"{scores[name]:.3f}".removeprefix("0") for name in COLUMNS]
        shares = [f"{area_m2 / of:.0%}" if of else "-" for area_m2, of in zip(areas_m2(row), plain, strict=True)]
        yield f"| {' | '.join([row.name, *values, way.get(row.name, '-'), *shares, f'{cost_ms:.1f}'])} |"


def shares_of_way(rows: Sequence[Row]) -> dict[str, str]:
    """Return each row's share of the way from BL-DC to the ceiling, by the mean, with its interval."""
    scores = score_everywhere(rows, IOU, Resampling())
    found = {entry.row.name: way.share(entry, HEADLINE) for entry, way in ways(scores)}
    return {name: f"{each.value:.0%} ({each.low:.0%} to {each.high:.0%})" for name, each in found.items()}


def areas_m2(row: Row) -> list[float]:
    """Return the area of the targets of a row in the classes behind each column."""
    cells = row.results[0].counts.sum(axis=(0, 2)) * grid_of(row).spec.cell_m ** 2
    return [float(cells[list(IOU.classes.averaged[name])].sum()) for name in COLUMNS]


def grid_of(row: Row) -> GridConfig:
    """Return how a row's grids were made, its target's sensors alone: others cost time and change nothing."""
    grid = row.results[0].grid
    assert grid is not None, "a run of this package tells"
    return grid.model_copy(update={"sensors": {name: grid.sensors[name] for name in grid.target}})


def frame_ms(grid: GridConfig, logs: Sequence[Path]) -> float:
    """Return the processor time in milliseconds that building the grid of one frame takes."""
    build_log(logs[0], grid)  # compiles
    found = []
    for log in logs:
        start_s = time.process_time()
        frames = sum(len(recording.stamps_ns) for recording in build_log(log, grid))
        found.append(1000 * (time.process_time() - start_s) / frames)
    return min(found)


def main() -> None:
    """Print the table of a run whose rows have results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("logs", type=Path)
    options = parser.parse_args()
    rows = [row for row in load_runs([options.run])[0].rows if row.results]
    for line in lines(rows, find_logs(options.logs)[:LOGS]):
        sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main()
