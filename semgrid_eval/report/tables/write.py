"""The report's files beside the page: long-form CSV, tables for papers, figures and one JSON for machines."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from semgrid_eval import __version__
from semgrid_eval.files import write_json, write_text
from semgrid_eval.report.claims.findings import Finding, finding_frame, finding_records
from semgrid_eval.report.claims.scaling import scaling
from semgrid_eval.report.estimates.bootstrap import (
    CATEGORY_COLUMNS,
    COLUMNS,
    DRAWS,
    LABELS,
    LEVEL,
    Estimate,
    RowScores,
    Scores,
)
from semgrid_eval.report.figures.settings import settings_frame
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.figures.training import training_frame
from semgrid_eval.report.page.provenance import data_sets, failures, matrix_file, matrix_text, window_frame
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.report.rows.pairing import reference_of
from semgrid_eval.report.tables.long import category_table, class_table
from semgrid_eval.report.tables.pace import pace_frame
from semgrid_eval.report.tables.regions import region_frame
from semgrid_eval.report.tables.side_by_side import Parts
from semgrid_eval.report.tables.table import ABSENT
from semgrid_eval.report.tables.where import BANDS, ORIGINS, Where

RECORD = "report.json"
FORMAT_VERSION = 2
_UNSCORED: dict[str, Any] = {"windows": 0, "scores": {}, "reference": None, "differences": {}}
_LATEX = str.maketrans(
    {
        **{character: f"\\{character}" for character in "&%$#_{}"},
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "\\": r"\textbackslash{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        '"': r"\textquotedbl{}",
        "[": "{[}",  # at the start of a line it would belong to the line break before it
        "*": "{*}",
    }
)


def write_tables(
    folder: Path,
    runs: Sequence[Run],
    scores: Scores,
    parts: Mapping[str, Parts],
    findings: Sequence[Finding],
) -> None:
    """Write every table of the report as CSV, summary.md, summary.tex, each run's matrix and report.json.

    `parts` are the scores of `regions` and of `paces`.
    """
    entries = list(scores.values())
    _write_csv(folder / "classes.csv", class_table(entries))
    _write_csv(folder / "categories.csv", category_table(entries))
    _write_csv(folder / "summary.csv", summary_table(scores))
    _write_csv(folder / "regions.csv", region_frame(parts["regions"]))
    _write_csv(folder / "paces.csv", pace_frame(parts["paces"]))
    _write_csv(folder / "findings.csv", finding_frame(findings))
    _write_csv(folder / "settings.csv", settings_frame(scores))
    _write_csv(folder / "training.csv", training_frame([row for run in runs for row in run.rows]))
    _write_csv(folder / "windows.csv", window_frame(runs))
    for run in runs:
        write_text(folder / matrix_file(run, runs), matrix_text(run))
    write_text(folder / "summary.md", markdown_table(scores))
    write_text(folder / "summary.tex", latex_table(scores))
    write_json(folder / RECORD, report_record(runs, scores, parts, findings))


def write_located(folder: Path, located: Sequence[Where]) -> None:
    """Write where.csv (row, split, part, value) and calibration.csv (row, certainty, right, cells)."""
    lines = [
        (entry.row.name, split, part, value)
        for entry in located
        for split, parts, values in (
            ("distance", BANDS, entry.band_scores()),
            ("seen", ORIGINS, entry.origin_shares()),
        )
        for part, value in zip(parts, values, strict=True)
    ]
    _write_csv(folder / "where.csv", pd.DataFrame(lines, columns=["row", "split", "part", "value"]))
    tables = [entry.calibration().assign(row=entry.row.name) for entry in located]
    empty = pd.DataFrame(columns=["row", "certainty", "right", "cells"])
    whole = pd.concat(tables)[list(empty.columns)] if tables else empty
    _write_csv(folder / "calibration.csv", whole)


def write_figures(folder: Path, figures: Mapping[str, Sequence[Plot]]) -> None:
    """Write each figure as PNG and SVG."""
    (folder / "figures").mkdir()
    for plot in (plot for group in figures.values() for plot in group):
        (folder / "figures" / f"{plot.name}.png").write_bytes(plot.png)
        (folder / "figures" / f"{plot.name}.svg").write_text(plot.svg, encoding="utf-8")


def summary_table(scores: Scores) -> pd.DataFrame:
    """Return one line for each row and column of scores: row, column, iou, low, high, seeds, windows."""
    lines = [
        (name, column, *_numbers(entry.estimate(column)), len(entry.row.results), entry.row.windows)
        for name, entry in scores.items()
        for column in COLUMNS
    ]
    return pd.DataFrame(lines, columns=["row", "score", "iou", "low", "high", "seeds", "windows"])


def markdown_table(scores: Scores) -> str:
    """Write the category scores as a Markdown table."""
    lines = [["Row", *(LABELS[column] for column in CATEGORY_COLUMNS)], ["---"] + ["---:"] * len(CATEGORY_COLUMNS)]
    lines += [[_markdown(name), *_texts(entry)] for name, entry in scores.items()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def latex_table(scores: Scores) -> str:
    """Write the category scores as a LaTeX table (package booktabs)."""
    heads = " & ".join(["Row", *(LABELS[column] for column in CATEGORY_COLUMNS)])
    lines = [r"\begin{tabular}{l" + "r" * len(CATEGORY_COLUMNS) + "}", r"\toprule", heads + r" \\", r"\midrule"]
    lines += [" & ".join([_latex(name), *_texts(entry)]) + r" \\" for name, entry in scores.items()]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""]).replace(ABSENT, "--")


def report_record(
    runs: Sequence[Run], scores: Scores, parts: Mapping[str, Parts], findings: Sequence[Finding]
) -> dict[str, Any]:
    """Return everything a machine may want to know of a report; absent values are null."""
    scored = _row_records(scores)
    return {
        "format_version": FORMAT_VERSION,
        "semgrid_eval": __version__,
        "interval": {"level": LEVEL, "draws": DRAWS, "over": "recordings, and seeds where there are several"},
        "runs": [
            {
                "tag": run.tag,
                "scaling": scaling(run),
                "data": data_sets(run.record),
                "record": run.record.model_dump(mode="json", exclude={"rows"}),
            }
            for run in runs
        ],
        "failures": [vars(failure) for failure in failures(runs)],
        "rows": {row.name: _row_facts(row) | scored.get(row.name, _UNSCORED) for run in runs for row in run.rows},
        **{kind: {name: _row_records(alone) for name, alone in found.items()} for kind, found in parts.items()},
        "findings": finding_records(findings),
    }


def _row_facts(row: Row) -> dict[str, Any]:
    return row.record.model_dump(mode="json", exclude={"results"}) | {
        "failures": row.failures,
        "results": [_result_record(result) for result in row.results],
    }


def _result_record(result: Result) -> dict[str, Any]:
    """Take all of a result's record but its windows, which `windows.csv` lists once for all rows."""
    left_out = {"format_version", "windows", "log_digests"}
    return result.record.model_dump(mode="json", exclude=left_out) | {"window_count": len(result.counts)}


def _row_records(scores: Scores) -> dict[str, Any]:
    rows = [entry.row for entry in scores.values()]
    return {name: _scores_record(entry, scores, rows) for name, entry in scores.items()}


def _scores_record(entry: RowScores, scores: Scores, rows: Sequence[Row]) -> dict[str, Any]:
    reference = reference_of(entry.row, rows)
    other = None if reference is None else scores[reference.name]
    return {
        "windows": entry.row.windows,
        "scores": {column: _json(entry.estimate(column)) for column in COLUMNS},
        "reference": None if reference is None else reference.name,
        "differences": {} if other is None else {column: _json(entry.minus(other, column)) for column in COLUMNS},
    }


def _json(estimate: Estimate) -> dict[str, float | None]:
    values = dict(zip(("value", "low", "high"), _numbers(estimate), strict=True))
    return {name: value if np.isfinite(value) else None for name, value in values.items()}


def _numbers(estimate: Estimate) -> tuple[float, float, float]:
    return estimate.value, estimate.low, estimate.high


def _texts(entry: RowScores) -> list[str]:
    return [f"{entry.mean[c]:.3f}" if np.isfinite(entry.mean[c]) else ABSENT for c in CATEGORY_COLUMNS]


def _markdown(text: str) -> str:
    escaped = "".join(f"\\{character}" if character in "\\`*_{}[]<>#|!&$~" else character for character in text)
    return _one_line(escaped)


def _latex(text: str) -> str:
    return _one_line(text).translate(_LATEX)


def _one_line(text: str) -> str:
    """Turn what ends a line, or cannot be printed, into spaces."""
    return " ".join("".join(character if character.isprintable() else " " for character in text).split())


def _write_csv(path: Path, table: pd.DataFrame) -> None:
    write_text(path, table.to_csv(index=False, float_format="%.6f", lineterminator="\n"))
