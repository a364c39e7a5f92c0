"""A table as LaTeX (package booktabs)."""

from semgrid_eval.report.tables.numbers import ABSENT, MINUS
from semgrid_eval.report.tables.table import Cell, Table, heads, lines, one_line

_ESCAPES = str.maketrans(
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
        ABSENT: "--",
        MINUS: "$-$",
    }
)


def as_latex(table: Table) -> str:
    """Write a table with intervals in small print and the best values in bold."""
    rows = [" & ".join(map(_escaped, heads(table))) + r" \\", r"\midrule"]
    rows += [" & ".join([_escaped(header), *map(_cell, cells)]) + r" \\" for header, cells in lines(table)]
    begin = r"\begin{tabular}{l" + "r" * len(table.columns) + "}"
    return "\n".join([begin, r"\toprule", *rows, r"\bottomrule", r"\end{tabular}", ""])


def _cell(cell: Cell) -> str:
    text = _escaped(cell.text)
    text = rf"\textbf{{{text}}}" if cell.tone == "best" else text
    return rf"{text} {{\scriptsize {_escaped(cell.note)}}}" if cell.note else text


def _escaped(text: str) -> str:
    return one_line(text).translate(_ESCAPES)
