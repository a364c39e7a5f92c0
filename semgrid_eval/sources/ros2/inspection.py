"""`convert ros2 --inspect`: the topics of a bag, with rates and offsets, and a first map file."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median

from semgrid_eval.errors import printable
from semgrid_eval.files import atomic_file
from semgrid_eval.sources.ros2 import kinds
from semgrid_eval.sources.ros2.contents import Contents, Seen, look_at
from semgrid_eval.sources.ros2.draft import draft_map

_NS_PER_MS = 1e6


def inspect_bags(paths: Sequence[Path], map_file: Path) -> str:
    """Describe bags, and write a first map of the first one; a map file that is there already stays.

    Raises:
        InputError: a bag cannot be read.
    """
    texts, first = [], None
    for path in paths:
        contents = look_at(path)
        first = first or contents
        texts.append(f"{path}\n{_table(contents)}")
    assert first is not None
    if map_file.exists():
        return "\n\n".join([*texts, f"{map_file} is there already and stays; --map names another one to write"])
    with atomic_file(map_file) as stream:
        stream.write(draft_map(first).encode())
    texts.append(f"{map_file} is a first map: read it, then: semgrid-eval convert ros2 BAG... OUT --map {map_file}")
    return "\n\n".join(texts)


def _table(contents: Contents) -> str:
    """Return a line for each topic: type, messages, rate, how late they were recorded, and what else is to say."""
    head = ("topic", "type", "messages", "Hz", "late ms", "")
    rows = [head, *(tuple(map(printable, _row(name, seen))) for name, seen in contents.topics.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)


def _row(name: str, seen: Seen) -> tuple[str, ...]:
    rate = "-" if seen.rate_hz is None else f"{seen.rate_hz:.4g}"
    late = f"{median(seen.late_ns) / _NS_PER_MS:.1f}" if seen.late_ns and any(seen.stamps_ns) else "-"
    return name, seen.kind, str(seen.count), rate, late, _note(seen)


def _note(seen: Seen) -> str:
    if seen.kind not in (*kinds.STAMPED, kinds.TRANSFORMS):
        return "not used"
    if seen.stamps_ns and not any(seen.stamps_ns):
        return "header stamps are all zero"
    told = seen.shape or seen.cloud
    return seen.fault or ("" if told is None else str(told))
