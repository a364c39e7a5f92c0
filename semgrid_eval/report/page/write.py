"""Writes a report: the page, and what lies beside it."""

from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from semgrid_eval import __version__
from semgrid_eval.classes import DEFAULT_CLASSES
from semgrid_eval.errors import InputError, printable
from semgrid_eval.files import atomic_folder, locked
from semgrid_eval.progress import Progress, silent
from semgrid_eval.report.claims.claims import MARGIN
from semgrid_eval.report.claims.findings import Finding, finding_table, missing_table, sentence
from semgrid_eval.report.estimates.bootstrap import SEED, Level, Parts, Resampling
from semgrid_eval.report.estimates.paces import EDGES_MPS
from semgrid_eval.report.examples.drawing import MASK_LEGEND, RIGHT_LEGEND, SHARE_ENDS, class_legend, class_style
from semgrid_eval.report.examples.errors import FEWEST_WINDOWS, error_maps
from semgrid_eval.report.examples.gallery import example_groups, gaps, widths
from semgrid_eval.report.examples.reel import make_reel
from semgrid_eval.report.examples.stream_reel import stream_reel
from semgrid_eval.report.page import exports, provenance
from semgrid_eval.report.page.chart import draw_chart
from semgrid_eval.report.page.chooser import chooser_axes
from semgrid_eval.report.page.exports import PAGE
from semgrid_eval.report.page.material import Material, gather
from semgrid_eval.report.page.replace import check_replaceable, keep_foreign
from semgrid_eval.report.page.summary import summarise, title_of
from semgrid_eval.report.rows.load import Row, Run, load_runs
from semgrid_eval.report.rows.pairing import Headline, headline
from semgrid_eval.report.tables.scores import confusion_table


def write_report(
    run: Path | Sequence[Path],
    out: Path | None = None,
    *,
    resample: Level = "recordings",
    progress: Progress = silent,
    damaged: Callable[[str], object] = len,
) -> Path:
    """Write the report of one run, or of several side by side, and return its page.

    Args:
        run: the folder of a run, or several.
        out: the folder to write; `report` in the run where it is not given, but several runs need one. A report there
            is replaced in one step, files in it that are not the report's stay, and others that write there at the same
            time wait.
        resample: what is resampled first: recordings, or groups of them (towns, cities, drives).
        progress: told of each row read.
        damaged: told of each file of a run that is damaged, lost or another's, in one line; the page says it, too.

    Raises:
        InputError: a run's record cannot be read or is given twice, or `out` is missing or holds something other than
            a report.
    """
    folders = [run] if isinstance(run, Path) else list(run)
    out = _checked(folders, out)
    check_replaceable(out)
    material = gather(load_runs(folders, progress=progress), Resampling(SEED, level=resample))
    with locked(out.parent, f".{out.name}.lock"):
        check_replaceable(out)
        with atomic_folder(out) as folder:
            records = exports.division_records(material.everything)
            exports.write_numbers(folder, material, records)
            exports.write_tables(folder, material)
            exports.write_figures(folder, material.figures)
            (folder / PAGE).write_text(render_page(material), encoding="utf-8")
            exports.write_record(folder, material, records)
            keep_foreign(out, folder)
    for each in material.runs:
        for fault in each.damages:
            damaged(f"{fault.kind} {fault.name}: {fault.reason}")
    return out / PAGE


def _checked(folders: Sequence[Path], out: Path | None) -> Path:
    """Return the folder to write, after looking whether the runs are several and each is another one."""
    if not folders:
        raise InputError("no run is given", field="run")
    for at, folder in enumerate(folders):
        if folder.resolve() in {other.resolve() for other in folders[:at]}:
            raise InputError("is given twice", path=folder, field="run")
    if out is None and len(folders) > 1:
        raise InputError("the report of several runs belongs to none of them: name a folder", field="out")
    return folders[0] / "report" if out is None else out


def render_page(material: Material) -> str:
    """Render the page as HTML that needs nothing but itself."""
    found = headline(material.scores)
    loader, strict = PackageLoader("semgrid_eval.report"), StrictUndefined
    environment = Environment(
        loader=loader, autoescape=True, undefined=strict, trim_blocks=True, lstrip_blocks=True, finalize=_shown
    )
    return environment.get_template("page.html.j2").render(
        **_frame(material),
        **_verdict(material, found),
        **_pictures(material, found),
        **_tables(material, found),
        **_origins(material.runs),
    )


def _frame(material: Material) -> dict[str, Any]:
    """Return what the page is made with, and what its parts share."""
    return {
        "style": Markup(class_style(material.classes)) + _source("style.css") + _source("examples.css"),
        "script": Markup().join(map(_source, ("page.js", "chooser.js", "examples.js", "reel.js", "colours.js"))),
        "version": __version__,
        "runs": material.runs,
        "own_classes": not material.classes.means(DEFAULT_CLASSES),
        "title": title_of(material.runs),
        "axes": chooser_axes(material.runs),
        "names": {row.number: row.name for run in material.runs for row in run.rows if row.results},
    }


def _verdict(material: Material, found: Headline | None) -> dict[str, Any]:
    """Return the head of the page and its one figure."""
    return {
        "summary": summarise(material.runs, material.scores, found, material.streams),
        "resampled": material.resampling.sentence,
        "chart": draw_chart(material.scores),
        "same": material.same,
    }


def _pictures(material: Material, found: Headline | None) -> dict[str, Any]:
    """Return examples and maps of errors, of rows that are no streams, which keep no predictions."""
    rows = [entry.row for entry in material.scores.values() if not entry.row.is_stream]
    shown = None if found is None or found.best.is_stream else found
    examples = example_groups(material.runs, rows, shown)
    return {
        "examples": examples,
        "reel": make_reel(material.scores, rows, shown, material.classes),
        "stream_reel": stream_reel(material.streams, material.classes),
        "gaps": gaps(rows, examples),
        "widths": widths(rows),
        "legend": (*class_legend(material.classes), MASK_LEGEND),
        "right_legend": RIGHT_LEGEND,
        "errors": error_maps(rows),
        "share_ends": SHARE_ENDS,
        "fewest_windows": FEWEST_WINDOWS,
    }


def _tables(material: Material, found: Headline | None) -> dict[str, Any]:
    """Return tables and figures of scores, and what is said beside them."""
    rows = [entry.row for entry in material.scores.values()]
    shown = () if found is None else filter(None, (found.best, found.reference or found.rival))
    return {
        "tables": material.tables,
        "figures": material.figures,
        "parts": material.parts,
        "order": material.order,
        "told": any(row.uses_truth for row in rows),
        "findings": [finding_view(each.tag, i, material.findings) for i, each in enumerate(material.runs)],
        "margin": MARGIN,
        "confusions": [confusion_table(material.scores[row.name], f"confusion-{i}") for i, row in enumerate(shown)],
        "stands_mps": EDGES_MPS[0],
        "unpaced": rows_without(material.everything["iou"]["paces"], rows),
    }


def _origins(runs: Sequence[Run]) -> dict[str, Any]:
    """Return where the numbers come from, and what failed."""
    return {
        "failures": provenance.failures(runs),
        "logs": provenance.log_table(runs),
        "results": provenance.result_table(runs),
        "commands": provenance.command_table(runs),
        "facts": [(each, provenance.facts(each, runs)) for each in runs],
    }


def rows_without(parts: Parts, rows: Sequence[Row]) -> list[str]:
    """Name the rows that no region of a division has."""
    known = {name for scores in parts.values() for name in scores}
    return [row.name for row in rows if row.name not in known]


def finding_view(tag: str, index: int, findings: Sequence[Finding]) -> dict[str, object]:
    """Make what the page shows of one run's findings."""
    mine, end = [each for each in findings if each.run == tag], f"-{index}" if index else ""
    tested, missing = finding_table(f"findings{end}", mine), missing_table(f"not-run{end}", mine)
    return {"tag": tag, "sentence": sentence(mine), "tested": tested, "missing": missing}


def _shown(value: object) -> object:
    """Escape what cannot be printed in names, wherever they come from; texts of several lines keep them."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return "\n".join(map(printable, value.split("\n")))


def _source(name: str) -> Markup:
    return Markup(resources.files("semgrid_eval.report").joinpath("templates", name).read_text(encoding="utf-8"))
