"""A table as Markdown."""

from semgrid_eval.report.tables.table import Cell, Table, heads, lines, one_line


def as_markdown(table: Table) -> str:
    """Write a table with intervals in brackets and the best values in bold."""
    rows = [[_escaped(head) for head in heads(table)], ["---"] + ["---:"] * len(table.columns)]
    rows += [[_escaped(header), *map(_cell, cells)] for header, cells in lines(table)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _cell(cell: Cell) -> str:
    text = _escaped(cell.text)
    text = f"**{text}**" if cell.tone == "best" else text
    return f"{text} ({_escaped(cell.note)})" if cell.note else text


def _escaped(text: str) -> str:
    return "".join(f"\\{each}" if each in "\\`*_{}[]<>#|!&$~" else each for each in one_line(text))
