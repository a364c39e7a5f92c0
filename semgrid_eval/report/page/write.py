"""Writes a report: one self-contained page, tables for people and for machines, and figures."""

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from semgrid_eval import __version__
from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_folder
from semgrid_eval.progress import Progress, silent
from semgrid_eval.report.claims.claims import MARGIN, in_paper
from semgrid_eval.report.claims.findings import Finding, finding_table, missing_table, sentence
from semgrid_eval.report.estimates.bootstrap import Level, Parts, Resampling, Scores
from semgrid_eval.report.estimates.paces import EDGES_MPS
from semgrid_eval.report.examples.drawing import CLASS_LEGEND, MASK_LEGEND, RIGHT_LEGEND, class_style, data_uri
from semgrid_eval.report.examples.gallery import example_groups, gaps, widths
from semgrid_eval.report.page import exports, provenance
from semgrid_eval.report.page.exports import Material, gather
from semgrid_eval.report.page.summary import summarise
from semgrid_eval.report.rows.load import Row, load_runs
from semgrid_eval.report.rows.pairing import Headline, headline
from semgrid_eval.report.tables.scores import confusion_table
from semgrid_eval.report.tables.table import Table

PAGE = "index.html"
_SEED = 20190623  # any number does; a fixed one gives the same run the same intervals


def write_report(
    run: Path | Sequence[Path], out: Path | None = None, *, resample: Level = "recordings", progress: Progress = silent
) -> Path:
    """Write the report of one run, or of several side by side, and return its page.

    Args:
        run: the folder of a run, or several.
        out: the folder to write; `report` in the (first) run where it is not given. A report there is replaced.
        resample: what is resampled first: recordings, or groups of them (towns, cities, drives).
        progress: told of each row read.

    Raises:
        InputError: a run's record cannot be read, or `out` holds something other than a report.
    """
    folders = [run] if isinstance(run, Path) else list(run)
    if not folders:
        raise InputError("no run is given", field="run")
    out = folders[0] / "report" if out is None else out
    _check_replaceable(out)
    material = gather(load_runs(folders, progress=progress), Resampling(_SEED, level=resample))
    with atomic_folder(out) as folder:
        exports.write_numbers(folder, material)
        exports.write_tables(folder, material)
        exports.write_figures(folder, material.figures)
        (folder / PAGE).write_text(render_page(material), encoding="utf-8")
    return out / PAGE


def render_page(material: Material) -> str:
    """Render the page as HTML that needs nothing but itself."""
    runs, scores = material.runs, material.scores
    found = headline(scores)
    rows = [entry.row for entry in scores.values()]
    examples = example_groups(runs, rows, found)
    loader, strict = PackageLoader("semgrid_eval.report"), StrictUndefined
    environment = Environment(loader=loader, autoescape=True, undefined=strict, trim_blocks=True, lstrip_blocks=True)
    environment.filters["svg_uri"] = lambda text: data_uri(text.encode(), "image/svg+xml")
    return environment.get_template("page.html.j2").render(
        style=Markup(class_style()) + _source("style.css") + _source("examples.css"),
        script=_source("page.js") + _source("examples.js") + _source("colours.js"),
        version=__version__,
        runs=runs,
        title=", ".join(each.record.title for each in runs),
        summary=summarise(runs, scores, found),
        resampled=material.resampling.sentence,
        tables=material.tables,
        parts=material.parts,
        about_settings=sum(not in_paper(e.row.record.name) for e in scores.values()) > len(scores) / 2,
        findings=[finding_view(each.tag, i, material.findings) for i, each in enumerate(runs)],
        margin=MARGIN,
        confusions=confusion_tables(scores, found),
        figures=material.figures,
        legend=(*CLASS_LEGEND, MASK_LEGEND),
        right_legend=RIGHT_LEGEND,
        examples=examples,
        gaps=gaps(rows, examples),
        widths=widths(rows),
        stands_mps=EDGES_MPS[0],
        unpaced=rows_without(material.everything["iou"]["paces"], rows),
        failures=provenance.failures(runs),
        logs=provenance.log_table(runs),
        results=provenance.result_table(runs),
        commands=provenance.command_table(runs),
        facts=[(each, provenance.facts(each, runs)) for each in runs],
    )


def rows_without(parts: Parts, rows: Sequence[Row]) -> list[str]:
    """Name the rows that no region of a division has."""
    known = {name for scores in parts.values() for name in scores}
    return [row.name for row in rows if row.name not in known]


def finding_view(tag: str, index: int, findings: Sequence[Finding]) -> dict[str, object]:
    """Make what the page shows of one run's findings."""
    mine, end = [each for each in findings if each.run == tag], f"-{index}" if index else ""
    tested, missing = finding_table(f"findings{end}", mine), missing_table(f"not-run{end}", mine)
    return {"tag": tag, "sentence": sentence(mine), "tested": tested, "missing": missing}


def confusion_tables(scores: Scores, found: Headline | None) -> list[Table]:
    """Make the confusion tables of the best row and of the baseline it is measured against."""
    rows = () if found is None else filter(None, (found.best, found.reference or found.rival))
    return [confusion_table(scores[row.name], f"confusion-{i}") for i, row in enumerate(rows)]


def _check_replaceable(out: Path) -> None:
    if not out.exists():
        return
    is_report = (out / exports.RECORD).is_file() and (out / PAGE).is_file()
    if not out.is_dir() or (any(out.iterdir()) and not is_report):
        raise InputError("exists and is not a report; name another folder", path=out, field="out")


def _source(name: str) -> Markup:
    return Markup(resources.files("semgrid_eval.report").joinpath("templates", name).read_text(encoding="utf-8"))
