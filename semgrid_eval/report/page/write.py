"""Writes a report: the page with its head in a few sentences and large figures, and what lies beside it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from math import isfinite
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from semgrid_eval import __version__
from semgrid_eval.errors import InputError, printable
from semgrid_eval.files import atomic_folder, locked
from semgrid_eval.progress import Progress, silent
from semgrid_eval.report.claims.claims import MARGIN, in_paper
from semgrid_eval.report.claims.findings import Finding, finding_table, missing_table, sentence
from semgrid_eval.report.estimates.bootstrap import LABELS, Estimate, Level, Parts, Resampling, Scores
from semgrid_eval.report.estimates.paces import EDGES_MPS
from semgrid_eval.report.examples.drawing import CLASS_LEGEND, MASK_LEGEND, RIGHT_LEGEND, class_style, data_uri
from semgrid_eval.report.examples.gallery import example_groups, gaps, widths
from semgrid_eval.report.page import exports, provenance
from semgrid_eval.report.page.exports import PAGE
from semgrid_eval.report.page.material import Material, gather
from semgrid_eval.report.page.replace import check_replaceable, keep_foreign
from semgrid_eval.report.rows.load import Row, Run, key_of, load_runs
from semgrid_eval.report.rows.pairing import DIFFERENCE_COLUMNS, HEADLINE, Headline, headline, verdict
from semgrid_eval.report.tables.numbers import MINUS, interval, interval_phrase, number, plural, signed
from semgrid_eval.report.tables.scores import confusion_table
from semgrid_eval.report.tables.streams import stream_sentence
from semgrid_eval.report.tables.truth import way_sentence

_SEED = 20190623  # any number does; a fixed one gives the same run the same intervals
_FEW_RECORDINGS, _FEW_SEEDS = 10, 5
_WORDS = {"gain": "clearly better", "loss": "clearly worse", "open": "not clearly different"}


@dataclass(frozen=True)
class Tile:
    """One difference, large: its label, the value, its interval and where they lie on a common axis (percent)."""

    label: str
    value: str
    note: str
    tone: str
    word: str
    title: str  # what stands behind it
    at: float = 50.0
    low: float = 50.0
    high: float = 50.0


@dataclass(frozen=True)
class Summary:
    """The head of a page: sentences, and tiles with what they compare."""

    sentences: tuple[str, ...]
    compared: str
    tiles: tuple[Tile, ...]


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
        out: the folder to write; `report` in the (first) run where it is not given. A report there is replaced in one
            step, files in it that are not the report's stay, and others that write there at the same time wait.
        resample: what is resampled first: recordings, or groups of them (towns, cities, drives).
        progress: told of each row read.
        damaged: told of each file of a run that is damaged, lost or another's, in one line; the page says it, too.

    Raises:
        InputError: a run's record cannot be read, or `out` holds something other than a report.
    """
    folders = [run] if isinstance(run, Path) else list(run)
    if not folders:
        raise InputError("no run is given", field="run")
    out = folders[0] / "report" if out is None else out
    check_replaceable(out)
    material = gather(load_runs(folders, progress=progress), Resampling(_SEED, level=resample))
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


def render_page(material: Material) -> str:
    """Render the page as HTML that needs nothing but itself."""
    runs, scores = material.runs, material.scores
    found = headline(scores)
    rows = [entry.row for entry in scores.values()]
    pictured = [row for row in rows if not row.is_stream]  # streams keep no predictions
    examples = example_groups(runs, pictured, None if found is None or found.best.is_stream else found)
    shown = () if found is None else filter(None, (found.best, found.reference or found.rival))
    loader, strict = PackageLoader("semgrid_eval.report"), StrictUndefined
    environment = Environment(
        loader=loader, autoescape=True, undefined=strict, trim_blocks=True, lstrip_blocks=True, finalize=_shown
    )
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
        order=material.order,
        streams=stream_sentence(material.streams),
        parts=material.parts,
        about_settings=sum(not in_paper(e.row.record.name) for e in scores.values()) > len(scores) / 2,
        findings=[finding_view(each.tag, i, material.findings) for i, each in enumerate(runs)],
        margin=MARGIN,
        confusions=[confusion_table(scores[row.name], f"confusion-{i}") for i, row in enumerate(shown)],
        figures=material.figures,
        legend=(*CLASS_LEGEND, MASK_LEGEND),
        right_legend=RIGHT_LEGEND,
        examples=examples,
        gaps=gaps(pictured, examples),
        widths=widths(pictured),
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


def _shown(value: object) -> object:
    """Escape what cannot be printed in names, wherever they come from; texts of several lines keep them."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return "\n".join(map(printable, value.split("\n")))


def _source(name: str) -> Markup:
    return Markup(resources.files("semgrid_eval.report").joinpath("templates", name).read_text(encoding="utf-8"))


def summarise(runs: Sequence[Run], scores: Scores, found: Headline | None) -> Summary:
    """Put a report into a few sentences."""
    which, evidence = _which(scores, found), _evidence(runs, scores)
    if found is None or (pair := _pair(found)) is None:
        return Summary((which, evidence), "", ())
    model, other = pair
    differences = {column: scores[model.name].minus(scores[other.name], column) for column in DIFFERENCE_COLUMNS}
    against = _in_words(model, other, differences)
    tiles = _tiles(model, other, differences)
    sentences = tuple(filter(None, (which, way_sentence(scores, found.best), against, evidence)))
    return Summary(sentences, f"{model.name} {MINUS} {other.name}", tiles)


def _which(scores: Scores, found: Headline | None) -> str:
    if found is None:
        return "No row has a score: nothing can be compared."
    best = scores[found.best.name]
    among = f"Of {found.compared} rows with the same targets, inputs and horizon, " * (found.compared < len(scores))
    start = f"{among}{found.best.name} has the highest mean class IoU, {number(best.mean[HEADLINE])} without unknown"
    if found.rival is None:
        return f"{start} ({interval_phrase(best.estimate(HEADLINE))}); there is no other row to compare with."
    lead = best.minus(scores[found.rival.name], HEADLINE)
    kind, word = _kind(found.best, found.rival), _WORDS[verdict(lead)]
    phrase = interval_phrase(lead, with_sign=True)
    return f"{start}: {signed(lead.value)} over {found.rival.name}, {kind}, {word} ({phrase})."


def _in_words(model: Row, other: Row, differences: Mapping[str, Estimate]) -> str:
    groups: dict[str, list[str]] = {}
    for column, difference in differences.items():
        if column != HEADLINE and isfinite(difference.value):  # not finite: a class that is nowhere
            text = f"{LABELS[column].lower()} ({signed(difference.value)})"
            groups.setdefault(verdict(difference), []).append(text)
    parts = [f"{_WORDS[word]} on {_listed(groups[word])}" for word in _WORDS if word in groups]
    return f"Against {other.name}, {model.name} is {'; '.join(parts)}." if parts else ""


def _evidence(runs: Sequence[Run], scores: Scores) -> str:
    rows = [entry.row for entry in scores.values()]
    records = [window for row in rows for result in row.results for window in result.record.windows]
    windows = len(set(map(key_of, records)))
    recordings = len({window.drive for window in records})
    text = f"This rests on {plural(windows, 'window')} from {plural(recordings, 'recording')}"
    seeds = [len(row.results) for row in rows if row.results[0].record.seed is not None]
    if seeds:
        span = plural(max(seeds), "seed") if min(seeds) == max(seeds) else f"{min(seeds)} to {max(seeds)} seeds"
        text += f" and {span} for each trained row"
    failed = sum(bool(row.failures) for run in runs for row in run.rows)
    text += f"; {plural(failed, 'row')} failed" if failed else "; no row failed"
    if left := sum(row.is_left for run in runs for row in run.rows):
        text += f", {left} {'was' if left == 1 else 'were'} not run yet"
    return f"{text}.{_doubt(recordings, seeds)}"


def _doubt(recordings: int, seeds: Sequence[int]) -> str:
    if recordings < 2:
        return " With fewer than two recordings there are no intervals."
    doubts = [" With so few recordings the intervals are rough."] if recordings < _FEW_RECORDINGS else []
    if seeds and min(seeds) < _FEW_SEEDS:
        part = "the" if min(seeds) == 1 else "much of the"
        doubts.append(f" Intervals of rows with {plural(min(seeds), 'seed')} leave out {part} chance in training.")
    return "".join(doubts)


def _tiles(model: Row, other: Row, differences: Mapping[str, Estimate]) -> tuple[Tile, ...]:
    bounds = [abs(v) for d in differences.values() for v in (d.value, d.low, d.high) if isfinite(v)]
    reach = 1.1 * max([*bounds, 1e-3])
    results = " and ".join(f"{plural(len(row.results), 'result')} of {row.name}" for row in (model, other))
    behind = f"{results}, {plural(model.windows, 'window')}"
    return tuple(_tile(LABELS[column], difference, reach, behind) for column, difference in differences.items())


def _tile(label: str, difference: Estimate, reach: float, behind: str) -> Tile:
    value, tone = signed(difference.value), verdict(difference)
    title = f"{label}: {behind}; {interval_phrase(difference, with_sign=True)}"
    if not isfinite(difference.value):
        return Tile(label, value, "", tone, "absent", title)
    ends = (v if isfinite(v) else difference.value for v in (difference.value, difference.low, difference.high))
    places = (round(50 + 50 * end / reach, 1) for end in ends)
    note = interval(difference, with_sign=True) or "no interval"
    return Tile(label, value, note, tone, _WORDS[tone], title, *places)


def _pair(found: Headline) -> tuple[Row, Row] | None:
    """Choose the two rows that the head of the page compares, a baseline as the second."""
    if found.rival is not None and found.best.is_baseline and not found.rival.is_baseline:
        return found.rival, found.best
    other = found.reference or found.rival
    return None if other is None else (found.best, other)


def _kind(best: Row, rival: Row) -> str:
    if best.is_baseline == rival.is_baseline:
        return "the runner-up"
    return "the best baseline" if rival.is_baseline else "the best model that is not a baseline"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
