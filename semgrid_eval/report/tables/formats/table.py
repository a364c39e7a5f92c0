"""The formats by the ends of their files' names."""

from collections.abc import Callable

from semgrid_eval.report.tables.formats.csv import as_csv
from semgrid_eval.report.tables.formats.json import as_json
from semgrid_eval.report.tables.formats.latex import as_latex
from semgrid_eval.report.tables.formats.markdown import as_markdown
from semgrid_eval.report.tables.table import Table

FORMATS: dict[str, Callable[[Table], str]] = {"csv": as_csv, "json": as_json, "md": as_markdown, "tex": as_latex}
