"""Writes a report: one self-contained page, tables for people and for machines, and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from semgrid_eval import __version__
from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_folder
from semgrid_eval.progress import Progress, silent
from semgrid_eval.report.claims.claims import MARGIN
from semgrid_eval.report.claims.findings import Finding, find, finding_table, missing_table, sentence
from semgrid_eval.report.claims.paper import in_paper
from semgrid_eval.report.estimates.bootstrap import Scores, score_rows
from semgrid_eval.report.examples.drawing import CLASS_LEGEND, MASK_LEGEND, RIGHT_LEGEND, data_uri
from semgrid_eval.report.examples.gallery import example_groups, gaps, widths
from semgrid_eval.report.figures import bars, calibration, horizon, settings, training
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.page import provenance
from semgrid_eval.report.page.colours import class_style
from semgrid_eval.report.page.summary import summarise
from semgrid_eval.report.rows.load import Row, Run, load_runs
from semgrid_eval.report.rows.pairing import DIFFERENCE_COLUMNS, Headline, headline
from semgrid_eval.report.tables import scores as tables
from semgrid_eval.report.tables import write as exports
from semgrid_eval.report.tables.changes import changes_table, not_compared_table
from semgrid_eval.report.tables.pace import PACE_EDGES_MPS, pace_tables, rows_without_pace, score_paces
from semgrid_eval.report.tables.regions import region_tables, score_regions
from semgrid_eval.report.tables.table import Table
from semgrid_eval.report.tables.where import Where, locate_rows

PAGE = "index.html"
_SEED = 20190623  # any number does; a fixed one gives the same run the same intervals


@dataclass(frozen=True)
class Material:
    """All that a report is written from.

    Args:
        runs: the runs as read from disk.
        scores: scores of all rows that have some.
        regions: the same of cells near moving and near standing actors alone.
        paces: the same of windows by how fast the vehicle drives in them.
        findings: what the runs say about the paper's claims.
        located: where rows are right.
        problems: of which rows that cannot be said, and why.
        figures: by section of the page.
    """

    runs: Sequence[Run]
    scores: Scores
    regions: Mapping[str, Scores]
    paces: Mapping[str, Scores]
    findings: Sequence[Finding]
    located: Sequence[Where]
    problems: Sequence[str]
    figures: Mapping[str, Sequence[Plot]]


def write_report(run: Path | Sequence[Path], out: Path | None = None, *, progress: Progress = silent) -> Path:
    """Write the report of one run, or of several side by side, and return its page.

    Args:
        run: the folder of a run, or several.
        out: the folder to write; `report` in the (first) run where it is not given. A report there is replaced.
        progress: told of each row read.

    Raises:
        InputError: a run's record cannot be read, or `out` holds something other than a report.
    """
    folders = [run] if isinstance(run, Path) else list(run)
    if not folders:
        raise InputError("no run is given", field="run")
    out = folders[0] / "report" if out is None else out
    _check_replaceable(out)
    material = gather(load_runs(folders, progress=progress))
    with atomic_folder(out) as folder:
        parts = {"regions": material.regions, "paces": material.paces}
        exports.write_tables(folder, material.runs, material.scores, parts, material.findings)
        exports.write_located(folder, material.located)
        exports.write_figures(folder, material.figures)
        (folder / PAGE).write_text(render_page(material), encoding="utf-8")
    return out / PAGE


def gather(runs: Sequence[Run]) -> Material:
    """Work out everything that a report shows."""
    rows = [row for each in runs for row in each.rows]
    scores = score_rows(rows, np.random.default_rng(_SEED))
    regions = score_regions(rows, _SEED)
    paces = score_paces(runs, [entry.row for entry in scores.values()], _SEED)
    located, problems = locate_rows(entry.row for entry in scores.values())
    figures = draw_figures(scores, rows, located)
    return Material(runs, scores, regions, paces, find(runs, scores, regions), located, problems, figures)


def draw_figures(scores: Scores, rows: Sequence[Row], located: Sequence[Where]) -> dict[str, list[Plot]]:
    """Draw all figures by section of the page."""
    return {
        "categories": bars.category_plots(scores),
        "horizon": horizon.horizon_plots(scores),
        "training": training.training_plots(rows),
        "calibration": calibration.calibration_plots(located),
        "settings": settings.settings_plots(scores),
    }


def render_page(material: Material) -> str:
    """Render the page as HTML that needs nothing but itself."""
    runs, scores = material.runs, material.scores
    found = headline(scores)
    rows = [entry.row for entry in scores.values()]
    examples = example_groups(runs, rows, found)
    environment = Environment(
        loader=PackageLoader("semgrid_eval.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["svg_uri"] = lambda text: data_uri(text.encode(), "image/svg+xml")
    return environment.get_template("page.html.j2").render(
        style=Markup(class_style()) + _source("style.css") + _source("examples.css"),
        script=_source("page.js") + _source("examples.js") + _source("colours.js"),
        version=__version__,
        runs=runs,
        title=", ".join(each.record.title for each in runs),
        summary=summarise(runs, scores, found),
        tables=page_tables(runs, scores)
        | tables.where_tables(material.located)
        | region_tables(material.regions)
        | pace_tables(material.paces),
        about_settings=sum(not in_paper(e.row.record.name) for e in scores.values()) > len(scores) / 2,
        findings=[finding_view(each.tag, i, material.findings) for i, each in enumerate(runs)],
        margin=MARGIN,
        confusions=confusion_tables(scores, found),
        problems=material.problems,
        figures=material.figures,
        legend=(*CLASS_LEGEND, MASK_LEGEND),
        right_legend=RIGHT_LEGEND,
        examples=examples,
        gaps=gaps(rows, examples),
        widths=widths(rows),
        stands_mps=PACE_EDGES_MPS[0],
        unpaced=rows_without_pace(rows, material.paces),
        failures=provenance.failures(runs),
        logs=provenance.log_table(runs),
        results=provenance.result_table(runs),
        commands=provenance.command_table(runs),
        facts=[(each, provenance.facts(each, runs)) for each in runs],
    )


def page_tables(runs: Sequence[Run], scores: Scores) -> dict[str, Table | None]:
    """Make the page's tables of scores; one with nothing to show is None or has no lines."""
    return {
        "categories": tables.category_values(scores),
        "differences": tables.difference_table("differences", scores, DIFFERENCE_COLUMNS),
        "class_differences": tables.difference_table("class-differences", scores, CLASS_NAMES),
        "classes": tables.class_values(scores),
        "changes": changes_table(scores),
        "not_compared": not_compared_table(scores),
        "merged": tables.merged_values(scores),
        "windows": tables.window_means(scores),
        "runs": tables.run_differences(scores, [each.tag for each in runs], DIFFERENCE_COLUMNS),
        "costs": tables.training_table(list(scores.values())),
    }


def finding_view(tag: str, index: int, findings: Sequence[Finding]) -> dict[str, object]:
    """Make what the page shows of one run's findings."""
    mine = [each for each in findings if each.run == tag]
    return {
        "tag": tag,
        "sentence": sentence(mine),
        "tested": finding_table(f"findings-{index}" if index else "findings", mine),
        "missing": missing_table(f"not-run-{index}" if index else "not-run", mine),
    }


def confusion_tables(scores: Scores, found: Headline | None) -> list[Table]:
    """Make the confusion tables of the best row and of the baseline it is measured against."""
    rows = [] if found is None else [row for row in (found.best, found.reference or found.rival) if row is not None]
    return [tables.confusion_table(scores[row.name], f"confusion-{i}") for i, row in enumerate(rows)]


def _check_replaceable(out: Path) -> None:
    if not out.exists():
        return
    is_report = (out / exports.RECORD).is_file() and (out / PAGE).is_file()
    if not out.is_dir() or (any(out.iterdir()) and not is_report):
        raise InputError("exists and is not a report; name another folder", path=out, field="out")


def _source(name: str) -> Markup:
    return Markup(resources.files("semgrid_eval.report").joinpath("templates", name).read_text(encoding="utf-8"))
