"""Drives that are too long for one recording are cut into equal parts."""

from itertools import pairwise

_NS_PER_S = 1e9


def count_of_parts(span_ns: int, longest_s: float) -> int:
    """Count the equal parts, no longer than asked for, of a span; 0 leaves it whole."""
    return max(1, -int(-span_ns // (longest_s * _NS_PER_S))) if longest_s else 1


def equal_parts(start: int, end: int, count: int) -> list[tuple[int, int]]:
    """Cut what lies between two whole numbers into parts, as equal as whole numbers allow; ends are exclusive."""
    return list(pairwise(start + (end - start) * part // count for part in range(count + 1)))
