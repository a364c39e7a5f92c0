"""The report's files beside the page: long tables, the page's own in several formats, figures and report.json."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from semgrid_eval import __version__
from semgrid_eval.files import write_json, write_text
from semgrid_eval.report.claims.findings import finding_frame, finding_records
from semgrid_eval.report.claims.paper import scaling
from semgrid_eval.report.estimates.bootstrap import LEVEL, everywhere
from semgrid_eval.report.figures.calibration import calibration_frame
from semgrid_eval.report.figures.settings import settings_frame
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.figures.training import training_frame
from semgrid_eval.report.page.material import Material
from semgrid_eval.report.page.provenance import data_sets, failures, matrix_file, matrix_text, window_frame
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.report.tables.formats.csv import as_csv, frame_csv
from semgrid_eval.report.tables.formats.json import as_json
from semgrid_eval.report.tables.formats.latex import as_latex
from semgrid_eval.report.tables.formats.markdown import as_markdown
from semgrid_eval.report.tables.long import division_records, seed_frame, summary_frame
from semgrid_eval.report.tables.table import Table

RECORD = "report.json"
FORMAT_VERSION = 3
FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": as_csv, "json": as_json, "md": as_markdown, "tex": as_latex}
"""By the ends of files' names; to add a format, add a line here."""
_UNSCORED: dict[str, Any] = {"windows": 0, "seeds": 0, "cells": {}, "scores": {}, "reference": None, "differences": {}}


def write_numbers(folder: Path, material: Material) -> None:
    """Write the long tables as CSV, each run's matrix and report.json."""
    runs, records = material.runs, division_records(material.everything)
    frames = {
        "summary": summary_frame(records),
        "scores": seed_frame(material.everything),
        "findings": finding_frame(material.findings),
        "calibration": calibration_frame(everywhere(material.everything, "calibration")),
        "settings": settings_frame(material.scores),
        "training": training_frame([row for run in runs for row in run.rows]),
        "windows": window_frame(runs),
    }
    for name, frame in frames.items():
        write_text(folder / f"{name}.csv", frame_csv(frame))
    for run in runs:
        write_text(folder / matrix_file(run, runs), matrix_text(run))
    write_json(folder / RECORD, report_record(material, records))


def write_tables(folder: Path, tables: Sequence[Table]) -> None:
    """Write the page's tables in every format below `tables/`; that of the categories is also summary.md and .tex."""
    for table in tables:
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
        "findings": finding_records(material.findings),
    }


def _bare(run: Run) -> dict[str, Any]:
    return run.record.model_dump(mode="json", exclude={"rows"})


def _row_facts(row: Row) -> dict[str, Any]:
    return row.record.model_dump(mode="json", exclude={"results"}) | {
        "failures": row.failures,
        "results": [_result_record(result) for result in row.results],
    }


def _result_record(result: Result) -> dict[str, Any]:
    """Take all of a result's record but its windows, which `windows.csv` lists once for all rows."""
    left_out = {"format_version", "windows", "log_digests"}
    return result.record.model_dump(mode="json", exclude=left_out) | {"window_count": len(result.record.windows)}
