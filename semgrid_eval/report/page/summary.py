"""The head of a page: who wins, by how much and how sure, in a few sentences and large figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from markupsafe import Markup

from semgrid_eval.errors import printable
from semgrid_eval.report.estimates.bootstrap import Scores, shared_iou
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.estimates.streams import Strategy
from semgrid_eval.report.rows.load import Row, Run, comparable, key_of
from semgrid_eval.report.rows.pairing import HEADLINE, VERDICTS, Headline, verdict
from semgrid_eval.report.rows.words import otherwise_asked, question_words
from semgrid_eval.report.tables.numbers import MINUS, interval, interval_phrase, number, signed
from semgrid_eval.report.tables.streams import stream_sentence
from semgrid_eval.report.tables.targets import fusion_sentence, not_compared_sentence
from semgrid_eval.report.tables.truth import way_sentence
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.words import plural

_FEW_RECORDINGS, _FEW_SEEDS = 10, 5
_UNSURE = "may be chance"
"""What a difference without interval is called: "not clearly different" says that there is one, which includes zero."""


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
    compared: str = ""
    tiles: tuple[Tile, ...] = ()
    terms: str = ""  # what the words of sentences and tiles mean


def summarise(runs: Sequence[Run], scores: Scores, found: Headline | None, streams: Sequence[Strategy] = ()) -> Summary:
    """Put a report into a few sentences."""
    rows = [entry.row for entry in scores.values()]
    evidence = _evidence(runs, [row for row in rows if found is None or comparable(row, found.best)])
    if found is None:
        return Summary(("No row has a score: nothing can be compared.", evidence))
    more = (
        stream_sentence(streams),
        way_sentence(scores, found.best),
        fusion_sentence(rows),
        not_compared_sentence(rows),
        evidence,
    )
    sentences = tuple(filter(None, (_like_for_like(scores, found), _of_all(scores, found), *more)))
    if found.rival is None:
        return Summary(sentences)
    tiles = _tiles(scores, found.best, found.rival)
    compared = f"{found.best.name} {MINUS} {found.rival.name}"
    return Summary(sentences, compared, tiles, _terms(shared_iou(scores.values())))


def _terms(iou: Iou) -> str:
    """Say what a window is, and which classes stand behind the tiles."""
    classes = iou.classes
    of = {column: ", ".join(iou.labels[classes.names[i]] for i in classes.averaged[column]) for column in iou.compared}
    groups = "; ".join(f"{iou.labels[column]}: {names}" for column, names in of.items() if column != HEADLINE)
    window = "A window is the inputs of one prediction and its target."
    return f"{window} IoU is intersection over union, averaged over classes; known are all but unknown. {groups}."


def _like_for_like(scores: Scores, found: Headline) -> Markup:
    best = scores[found.best.name]
    several = found.compared < found.sharing
    asked = f"Like for like ({question_words(found.best, found.best)}; {plural(found.compared, 'row')}), " * several
    value = number(best.mean[HEADLINE])
    start = _say("{}{} has the highest mean IoU of known classes, {}", asked, _name(found.best), value)
    if found.rival is None or found.next_best is None:
        alone = "no other row is asked the same" if several else "there is no other row to compare with"
        return start + _say(" ({}); {}.", interval_phrase(best.estimate(HEADLINE)), alone)
    behind = [found.next_best] if found.next_best == found.rival else [found.next_best, found.rival]
    over = (_over(best.minus(scores[row.name], HEADLINE), row, _kind(found, row)) for row in behind)
    return start + _say(": {}.", ", and ".join(over))


def _over(lead: Estimate, row: Row, kind: str) -> str:
    """Say how far a row is behind; what rounds to nothing is no lead."""
    if round(lead.value, 3) == 0:
        return f"as high as {row.name}, {kind} ({interval_phrase(lead, with_sign=True)})"
    return f"{signed(lead.value)} over {row.name}, {kind}, {_verdict(lead)}"


def _of_all(scores: Scores, found: Headline) -> Markup | str:
    """Say which row is the best of all with the same targets, and what it is asked that the other one is not."""
    if found.sharing == found.compared:
        return ""
    if found.overall == found.best:
        return f"It is also the best of all {found.sharing} rows with these targets."
    overall = scores[found.overall.name]
    lead = overall.minus(scores[found.best.name], HEADLINE)
    start = _say("Of all {} rows with these targets, {} is best, ", found.sharing, _name(found.overall))
    value = f"{number(overall.mean[HEADLINE])}: {signed(lead.value)} over {found.best.name}, {_verdict(lead)}."
    mine, theirs = otherwise_asked(found.overall, found.best), otherwise_asked(found.best, found.overall)
    why = f" It differs in what it is given or asked: {mine} instead of {theirs}."
    return start + _say("{}{}", value, why)


def _say(text: str, *parts: object) -> Markup:
    """Fill in parts, escaped, what cannot be printed in them, too."""
    shown = (part if isinstance(part, Markup) else printable(str(part)) for part in parts)
    return Markup(text).format(*shown)


def _name(row: Row) -> Markup:
    return _say("<strong>{}</strong>", row.name)


def _verdict(difference: Estimate) -> str:
    word = VERDICTS[verdict(difference)] if isfinite(difference.low) else f"which {_UNSURE}"
    return f"{word} ({interval_phrase(difference, with_sign=True)})"


def _evidence(runs: Sequence[Run], rows: Sequence[Row]) -> str:
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
    if skipped := sum(row.is_skipped for run in runs for row in run.rows):
        text += f", {plural(skipped, 'row')} skipped for lack of a truth"
    return f"{text}.{_doubt(recordings, seeds)}"


def _doubt(recordings: int, seeds: Sequence[int]) -> str:
    if recordings < 2:
        return " With fewer than two recordings there are no intervals."
    doubts = [" With so few recordings the intervals are rough."] if recordings < _FEW_RECORDINGS else []
    if seeds and min(seeds) < _FEW_SEEDS:
        part = "the" if min(seeds) == 1 else "much of the"
        doubts.append(f" Intervals of rows with {plural(min(seeds), 'seed')} leave out {part} chance in training.")
    return "".join(doubts)


def _tiles(scores: Scores, best: Row, rival: Row) -> tuple[Tile, ...]:
    iou = shared_iou(scores.values())
    differences: Mapping[str, Estimate] = {
        column: scores[best.name].minus(scores[rival.name], column) for column in iou.compared
    }
    bounds = [abs(v) for d in differences.values() for v in (d.value, d.low, d.high) if isfinite(v)]
    reach = 1.1 * max([*bounds, 1e-3])
    results = " and ".join(f"{plural(len(row.results), 'result')} of {row.name}" for row in (best, rival))
    behind = f"{results}, {plural(best.windows, 'window')}"
    return tuple(_tile(iou.labels[column], difference, reach, behind) for column, difference in differences.items())


def _tile(label: str, difference: Estimate, reach: float, behind: str) -> Tile:
    value, tone = signed(difference.value), verdict(difference)
    title = f"{label}: {behind}; {interval_phrase(difference, with_sign=True)}"
    if not isfinite(difference.value):
        return Tile(label, value, "", tone, "absent", title)
    ends = (v if isfinite(v) else difference.value for v in (difference.value, difference.low, difference.high))
    places = (round(50 + 50 * end / reach, 1) for end in ends)
    note = interval(difference, with_sign=True)
    word = VERDICTS[tone] if note else _UNSURE
    return Tile(label, value, note or "no interval", tone, word, title, *places)


def _kind(found: Headline, row: Row) -> str:
    if found.best.is_baseline == row.is_baseline:
        return "the next best"
    return "the best baseline" if row.is_baseline else "the best model that is not a baseline"


def title_of(runs: Sequence[Run]) -> str:
    """Name a page by its runs' titles, with what tells them apart in front."""
    titles = [run.record.title for run in runs]
    if len(runs) < 2:
        return titles[0]
    if len(set(titles)) == 1:
        return f"{' and '.join(run.tag for run in runs)}: {titles[0]}"
    return "; ".join(f"{run.tag}: {run.record.title}" for run in runs)
