"""Counts with their nouns, as every message, table and page writes them."""


def plural(count: int, noun: str, several: str = "") -> str:
    """Write a count with its noun; `several` is the noun's plural where that is more than an s."""
    return f"{count:,} {noun if count == 1 else several or f'{noun}s'}"
