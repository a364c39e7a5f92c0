"""What formats of text share: names and numbers as one line."""

from collections.abc import Iterator

from semgrid_eval.report.tables.table import Cell, Table


def one_line(text: str) -> str:
    """Turn what ends a line, or cannot be printed, into spaces."""
    return " ".join("".join(character if character.isprintable() else " " for character in text).split())


def heads(table: Table) -> list[str]:
    """Return the headers of all columns, with the region of each where there are several."""
    several = len(dict(table.columns)) < len(table.columns)
    parts = ((label, note.rpartition(", ")[0]) for label, note in table.columns)
    return [table.corner, *(f"{label} ({part})" if several and part else label for label, part in parts)]


def lines(table: Table) -> Iterator[tuple[str, tuple[Cell, ...]]]:
    """Go through the lines; the header of one that belongs to another names that one, too."""
    for body in table.bodies:
        for line in body:
            yield line.header if line is body[0] else f"{body[0].header}: {line.header}", line.cells
