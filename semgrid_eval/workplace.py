"""Where work may run and what it may use: plain values, light to import."""

from dataclasses import dataclass

LOCAL = "local"
"""This machine, as the name of an executor and as the address of a cluster that is started here."""


@dataclass(frozen=True)
class Limits:
    """What a process apart may use; None is no limit."""

    time_s: float | None = 3600.0  # without any sign: an answer, or progress on the way to it
    memory_bytes: int | None = None  # of its data, on systems that know such a limit
