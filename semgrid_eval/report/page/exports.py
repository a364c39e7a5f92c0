"""A report's files beside the page: long tables, the page's own, figures, report.json."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from semgrid_eval import __version__
from semgrid_eval.files import write_json, write_text
from semgrid_eval.report.claims.claims import scaling
from semgrid_eval.report.claims.findings import finding_frame, finding_records
from semgrid_eval.report.estimates.bootstrap import Everything, RowScores, Scores, everywhere
from semgrid_eval.report.estimates.intervals import LEVEL, Estimate
from semgrid_eval.report.estimates.way import Way, ways
from semgrid_eval.report.figures.curves import calibration_frame, timing_frame, training_frame
from semgrid_eval.report.figures.settings import settings_frame
from semgrid_eval.report.figures.streams import stream_frame
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.page.material import Material
from semgrid_eval.report.page.provenance import data_sets, failures, matrix_file, matrix_text, window_frame
from semgrid_eval.report.rows.load import Row, Run
from semgrid_eval.report.tables.formats.csv import as_csv, frame_csv
from semgrid_eval.report.tables.formats.json import as_json
from semgrid_eval.report.tables.formats.latex import as_latex
from semgrid_eval.report.tables.formats.markdown import as_markdown
from semgrid_eval.report.tables.numbers import finite
from semgrid_eval.report.tables.table import Table
from semgrid_eval.report.tables.values import reference_scores
from semgrid_eval.scores.metrics.metric import column_names
from semgrid_eval.scores.tidy import FIGURE_COLUMNS

LEADS_FILE = "leads.json"
"""The best leads of streams, which a row's `lead_ms: from FILE` reads."""
PAGE, RECORD = "index.html", "report.json"
FILES = "files"
"""The key in report.json of the names of all files of the report."""
FORMAT_VERSION = 3
FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": as_csv, "json": as_json, "md": as_markdown, "tex": as_latex}
"""By the ends of files' names; to add a format, add a line here."""
_UNSCORED: dict[str, Any] = {
    "windows": 0,
    "seeds": 0,
    "cells": {},
    "scores": {},
    "reference": None,
    "differences": {},
    "shares": {},
}
SUMMARY_COLUMNS = (
    *("row", "metric", "division", "region", "column", "value", "low", "high"),
    *("reference", "difference", "difference_low", "difference_high", "cells", "windows", "seeds"),
    *("share", "share_low", "share_high"),
)
_SHARE = {"value": "share", "low": "share_low", "high": "share_high"}
_DIFFERENCE = {"value": "difference", "low": "difference_low", "high": "difference_high"}

Records = Mapping[str, Mapping[str, Mapping[str, Mapping[str, dict[str, Any]]]]]
"""What machines may want to know of a row, by the names of metric, division, region and row."""
T = TypeVar("T")


def write_numbers(folder: Path, material: Material, records: Records) -> None:
    """Write the long tables as CSV, and each run's matrix."""
    runs = material.runs
    frames = {
        "summary": summary_frame(records),
        "expected": summary_frame(division_records(material.expected)),
        "scores": seed_frame(material.everything),
        "findings": finding_frame(material.findings),
        "streams": stream_frame(material.streams),
        "calibration": calibration_frame(everywhere(material.everything, "calibration")),
        "settings": settings_frame(material.scores),
        "training": training_frame([row for run in runs for row in run.rows]),
        "timings": timing_frame([row for run in runs for row in run.rows]),
        "windows": window_frame(runs),
    }
    for name, frame in frames.items():
        write_text(folder / f"{name}.csv", frame_csv(frame))
    for run in runs:
        write_text(folder / matrix_file(run, runs), matrix_text(run))
    if material.best_leads:
        write_json(folder / LEADS_FILE, {"lead_ms": dict(material.best_leads)})


def write_record(folder: Path, material: Material, records: Records) -> None:
    """Write report.json when all else is written, and list there what that is."""
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    record = report_record(material, records)
    write_json(folder / RECORD, record | {FILES: [*files, RECORD]})


def write_tables(folder: Path, material: Material) -> None:
    """Write the tables of scores in each format below `tables/`; that of the categories is also summary.md and .tex."""
    tables = [*material.tables.values(), *(table for each in material.parts.values() for table in each)]
    for table in (table for table in tables if table is not None and table.bodies):
        for end, written in FORMATS.items():
            write_text(folder / "tables" / f"{table.name}.{end}", written(table))
        if table.name == "categories":
            for end in ("md", "tex"):
                write_text(folder / f"summary.{end}", FORMATS[end](table))


def write_figures(folder: Path, figures: Mapping[str, Sequence[Plot]]) -> None:
    """Write each figure as PNG and SVG."""
    (folder / "figures").mkdir()
    for plot in (plot for group in figures.values() for plot in group):
        (folder / "figures" / f"{plot.name}.png").write_bytes(plot.png)
        (folder / "figures" / f"{plot.name}.svg").write_text(plot.svg, encoding="utf-8")


def report_record(material: Material, records: Mapping[str, Any]) -> dict[str, Any]:
    """Return everything a machine may want to know of a report; absent values are null."""
    runs, resampling = material.runs, material.resampling
    scored = records["iou"]["all"].get("all", {})
    interval = {"level": LEVEL, "draws": resampling.draws, "over": resampling.level, "why": resampling.sentence}
    return {
        "format_version": FORMAT_VERSION,
        "semgrid_eval": __version__,
        "interval": interval,
        "runs": [{"tag": r.tag, "scaling": scaling(r), "data": data_sets(r.record), "record": _bare(r)} for r in runs],
        "failures": [vars(failure) for failure in failures(runs)],
        "rows": {row.name: _row_facts(row) | scored.get(row.name, _UNSCORED) for run in runs for row in run.rows},
        "metrics": records,
        "expected": {"order": material.order, "metrics": division_records(material.expected)},
        "findings": finding_records(material.findings),
    }


def _bare(run: Run) -> dict[str, Any]:
    return run.record.model_dump(mode="json", exclude={"rows"})


def _row_facts(row: Row) -> dict[str, Any]:
    left_out = {"format_version", "windows", "log_digests"}  # `windows.csv` lists windows once for all rows
    records = [each.record for each in row.results]
    results = [each.model_dump(mode="json", exclude=left_out) | {"window_count": len(each.windows)} for each in records]
    facts = row.record.model_dump(mode="json", exclude={"results"})
    return facts | {"failures": row.failures, "results": results}


def summary_frame(records: Records) -> pd.DataFrame:
    """Return one line for every figure of `division_records`."""
    lines = [
        {**place, "row": name, **record, "column": column, "cells": record["cells"][column]}
        | record["scores"][column]
        | {_DIFFERENCE[key]: value for key, value in record["differences"].get(column, {}).items()}
        | {_SHARE[key]: value for key, value in record["shares"].get(column, {}).items()}
        for place, region in _regions(records)
        for name, record in region.items()
        for column in record["scores"]
    ]
    return pd.DataFrame(lines, columns=list(SUMMARY_COLUMNS))


def seed_frame(everything: Everything) -> pd.DataFrame:
    """Return one line for every figure of every row and seed."""
    scored = ((place, entry) for place, scores in _regions(everything) for entry in scores.values())
    lines = [line for place, entry in scored for line in _seeds(entry, place)]
    return pd.DataFrame(lines, columns=list(FIGURE_COLUMNS)).astype({"seed": "Int64"})


def division_records(everything: Everything) -> Records:
    """Return every figure with its interval and its difference to the row's baseline, for machines."""
    rows = [entry.row for entry in everywhere(everything, "iou").values()]
    return {
        metric: {
            division: {region: _region_records(scores, rows) for region, scores in parts.items()}
            for division, parts in divisions.items()
        }
        for metric, divisions in everything.items()
    }


def _regions(of: Mapping[str, Mapping[str, Mapping[str, T]]]) -> Iterator[tuple[dict[str, str], T]]:
    for metric, by_division in of.items():
        for division, parts in by_division.items():
            for region, found in parts.items():
                yield {"metric": metric, "division": division, "region": region}, found


def _region_records(scores: Scores, rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    found = {entry.row.name: way for entry, way in ways(scores, rows)}
    return {name: _record(entry, scores, rows, found.get(name)) for name, entry in scores.items()}


def _record(entry: RowScores, scores: Scores, rows: Sequence[Row], way: Way | None) -> dict[str, Any]:
    other = reference_scores(entry, scores, rows)
    return {
        "windows": entry.windows,
        "seeds": len(entry.results),
        "cells": entry.cells,
        "scores": _estimates(entry.estimates),
        "reference": None if other is None else other.row.name,
        "differences": {} if other is None else _estimates(entry.differences(other)),
        "shares": {} if way is None else _estimates(way.shares(entry, column_names(entry.metric))),
    }


def _estimates(found: Mapping[str, Estimate]) -> dict[str, dict[str, float | None]]:
    return {column: {name: finite(value) for name, value in vars(each).items()} for column, each in found.items()}


def _seeds(entry: RowScores, place: dict[str, str]) -> Iterator[dict[str, Any]]:
    shared = {**place, "row": entry.row.name, "windows": entry.windows}
    of_seeds = zip(entry.results, entry.by_seed.tolist(), entry.metric.cells(entry.totals).tolist(), strict=True)
    for result, values, cells in of_seeds:
        for column, value, count in zip(column_names(entry.metric), values, cells, strict=True):
            yield {**shared, "seed": result.record.seed, "column": column, "value": value, "cells": count}
