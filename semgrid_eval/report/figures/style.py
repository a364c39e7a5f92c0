"""What a figure of the report is: PNG and SVG, one style, and a form that is part of a page and follows its theme."""

import io
import re
import textwrap
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from markupsafe import escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from PIL import Image

from semgrid_eval.errors import printable
from semgrid_eval.report.claims.claims import is_papers
from semgrid_eval.report.estimates.bootstrap import Scores
from semgrid_eval.report.rows.load import Row
from semgrid_eval.words import plural

# Okabe and Ito's colours, which colour-blind readers can tell apart.
PALETTE = ("#e69f00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
STROKES = ("-", "--", ":", "-.")
INK, MUTED, RULE = "#2a2f36", "#5d6670", "#d5d9de"
_PROPERTIES = {INK: "--ink", MUTED: "--muted", RULE: "--rule"}
"""Of a page that a figure becomes a part of, by colour."""
SETTINGS: Any = {
    "font.family": "sans-serif",
    "font.size": 9,
    "text.parse_math": False,  # names are text, whatever dollar signs they hold
    "svg.fonttype": "none",
    "svg.hashsalt": "semgrid-eval",
    "axes.facecolor": "none",  # a page in the dark has no white boxes
    "axes.edgecolor": RULE,
    **dict.fromkeys(("axes.labelcolor", "axes.titlecolor", "text.color", "xtick.color", "ytick.color"), INK),
    "axes.titlesize": 10,
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
}
PAPER_MARKS: Any = {"markerfacecolor": "white", "markeredgecolor": INK, "markeredgewidth": 0.8}
"""How the paper's own values are marked: small hollow diamonds."""
_LEFT_OUT = re.compile(r'<metadata>.*?</metadata>|<!--.*?-->|<g id="patch_1">.*?</g>', re.DOTALL)
_TAG = re.compile(r"<[a-z][^<>]*>")
_NAMESPACE = re.compile(r' xmlns(:\w+)?="[^"]*"')
_ID = re.compile(r' id="([^"]*)"')
_REFERENCE = re.compile(r'(url\(#|href="#)([^)"]+)')
_MARK = "row-"
_ROWS = re.compile(r"row-([\d-]+)\.\d+")
_NAME_CHARACTERS = 24
_PICTURE_DPI = 160
WIDE_IN = 11.3
"""All of the page."""
_PANELS_IN_A_ROW, _TITLE_CHARACTERS = 5, 16


@dataclass(frozen=True)
class Plot:
    """A figure in both forms, the table it was drawn from, what it shows in words, and its natural width."""

    name: str
    png: bytes
    svg: str
    source: str
    caption: str
    width_px: int

    @property
    def inline_svg(self) -> str:
        """The SVG as a part of a page: in the page's colours, without a background, what belongs to a row marked."""
        text = _LEFT_OUT.sub("", self.svg)
        used = {name for _, name in _REFERENCE.findall(text)}

        def identity(found: re.Match[str]) -> str:
            if rows := _ROWS.fullmatch(found[1]):
                return f' data-row="{rows[1].replace("-", " ")}"'
            return f' id="{self.name}-{found[1]}"' if found[1] in used else ""

        def tag(found: re.Match[str]) -> str:
            fitted = _REFERENCE.sub(rf"\g<1>{self.name}-\g<2>", _NAMESPACE.sub("", found[0]))
            for colour, name in _PROPERTIES.items():
                fitted = fitted.replace(colour, f"var({name})")
            return _ID.sub(identity, fitted)

        text = _TAG.sub(tag, text)
        return text.replace("<svg", f'<svg role="img" aria-label="{escape(printable(self.caption))}"', 1)


def evidence(scores: Scores) -> str:
    """Count the windows and recordings behind a figure's rows."""
    windows = {entry.row.windows for entry in scores.values()}
    records = (w for entry in scores.values() for w in entry.row.results[0].record.windows)
    recordings = len({window.drive for window in records})
    count = plural(max(windows), "window") if len(windows) == 1 else f"{min(windows)} to {max(windows)} windows"
    return f"{count} a row, {plural(recordings, 'recording')}"


def paper_note(scores: Scores) -> str:
    """End a caption, saying what the diamonds are where the paper has any of the rows."""
    beside = any(is_papers(entry.row) for entry in scores.values())
    return "; diamonds are the paper's values, on Cityscapes." if beside else "."


def family_colours(rows: Iterable[Row]) -> dict[str, str]:
    """Return a colour for each family of models, those of baselines first."""
    families = dict.fromkeys(row.record.facts.family for row in sorted(rows, key=lambda row: not row.is_baseline))
    return {family: PALETTE[i % len(PALETTE)] for i, family in enumerate(families)}


def truth_strokes(rows: Iterable[Row]) -> dict[str, Any]:
    """Return the stroke of each model that is told of the truth, a whole line for what nobody exceeds."""
    told = sorted((row.record.facts for row in rows if row.uses_truth), key=lambda facts: facts.bound != "upper")
    return {model: STROKES[i % len(STROKES)] for i, model in enumerate(dict.fromkeys(facts.model for facts in told))}


def line_style(index: int) -> dict[str, Any]:
    """Return the colour and stroke of one of many lines."""
    colours = len(PALETTE)
    return {"color": PALETTE[index % colours], "linestyle": STROKES[index // colours % len(STROKES)]}


def line_styles(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return how each row's line is drawn: in colours, and black where a row is told of the truth."""
    told = truth_strokes(rows)
    return [
        {"color": INK, "linestyle": told[row.record.facts.model]} if row.uses_truth else line_style(index)
        for index, row in enumerate(rows)
    ]


def panel_grid(count: int) -> tuple[int, int]:
    """Return in how many rows, of how many panels each, as many panels as that fit on a page."""
    rows = ceil(count / _PANELS_IN_A_ROW)
    return rows, ceil(count / rows)


def draw_panels(figure: Figure, titles: Sequence[str], **shared: Any) -> list[Axes]:  # noqa: ANN401 - `subplots`' own
    """Add a panel for each title, row by row as `panel_grid` says."""
    found: list[Axes] = figure.subplots(*panel_grid(len(titles)), squeeze=False, **shared).ravel().tolist()
    for spare in found[len(titles) :]:
        spare.remove()
    panels = found[: len(titles)]
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(textwrap.fill(title, _TITLE_CHARACTERS), loc="left", fontweight="bold")
        axes.tick_params(labelbottom=True)  # below a panel of an upper row there may be none
    return panels


def short(name: str, characters: int = _NAME_CHARACTERS) -> str:
    """Cut a name to what fits beside a bar; control characters, which XML forbids, become spaces."""
    name = "".join(character if character.isprintable() else " " for character in name)
    return name if len(name) <= characters else f"{name[: characters - 1]}\N{HORIZONTAL ELLIPSIS}"


def mark(rows: Iterable[Row], *artists: Artist) -> None:
    """Mark parts of a figure as belonging to rows, so that a page can show and hide them together."""
    numbers = "-".join(str(row.number) for row in rows)
    for artist in artists:
        artist.set_gid(f"{_MARK}{numbers}")


def mark_legend(legend: Legend, rows: Iterable[Iterable[Row]]) -> None:
    """Mark the entries of a legend, in their order."""
    for mine, handle, text in zip(rows, legend.legend_handles, legend.get_texts(), strict=True):
        mark(mine, *filter(None, (handle, text)))


def finish(figure: Figure, name: str, source: str, caption: str) -> Plot:
    """Save a figure in both forms, the same figure always as the same bytes."""
    picture, drawing = io.BytesIO(), io.BytesIO()
    for i, artist in enumerate(figure.findobj(lambda artist: (artist.get_gid() or "").startswith(_MARK))):
        artist.set_gid(f"{artist.get_gid()}.{i}")  # each id once
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # names may be in any script
        canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
        figure.set_dpi(_PICTURE_DPI)
        canvas.draw()  # lays the figure out, too
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        Image.fromarray(pixels.copy()).save(picture, "PNG", dpi=(_PICTURE_DPI, _PICTURE_DPI))
        figure.set_layout_engine("none")  # it has done its work; without this, it would be laid out again
        figure.savefig(drawing, format="svg", metadata={"Date": None, "Creator": None})
    text = drawing.getvalue().decode()
    width_px = round(96 * figure.get_size_inches()[0])
    return Plot(name, picture.getvalue(), text[text.index("<svg") :], source, caption, width_px)
