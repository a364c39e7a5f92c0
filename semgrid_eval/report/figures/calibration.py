"""How honest certainty is: the share of right cells over how certain a model was of them."""

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from semgrid_eval.report.figures.style import INK, SETTINGS, Plot, finish, line_style, short
from semgrid_eval.report.tables.where import Where


def calibration_plots(found: Sequence[Where]) -> list[Plot]:
    """Draw the share of right cells over certainty, and of all cells below, for rows whose certainty varies."""
    curves = [(entry, table) for entry in found if len(table := entry.calibration()) > 1]
    if not curves:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        right, cells = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        right.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle=":")
        for index, (entry, table) in enumerate(curves, start=1):
            style = line_style(index) | {"label": f"{short(entry.row.name)}, error {entry.calibration_error():.3f}"}
            right.plot(table.certainty, table.right, marker="o", markersize=3, **style)
            cells.plot(table.certainty, table.cells / table.cells.sum(), linewidth=1.2, **style)
        right.set(ylabel="share of right cells", xlim=(0, 1), ylim=(0, 1))
        cells.set(xlabel="certainty", ylabel="of all cells", yscale="log")
        cells.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        right.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        caption = "How often a model is right when it is so certain, above, and how many cells that are, below: of the"
        caption += " cells that it does not leave unknown (first repeat). It is honest on the dotted line; error is the"
        caption += " expected calibration error."
        return [finish(figure, "calibration", "calibration.csv", caption)]
