"""How numbers, intervals and counts are written."""

import math

from semgrid_eval.report.estimates.intervals import LEVEL, Estimate

ABSENT = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"


def number(value: float) -> str:
    """Write an IoU with three digits, a dash where it is absent."""
    return f"{value:.3f}" if math.isfinite(value) else ABSENT


def signed(value: float) -> str:
    """Write a difference with its sign; none at all has no sign."""
    if value == 0:
        return "0.000"
    return f"{value:+.3f}".replace("-", MINUS) if math.isfinite(value) else ABSENT


def interval(estimate: Estimate, *, with_sign: bool = False) -> str:
    """Write an interval, empty where there is none."""
    if not math.isfinite(estimate.low):
        return ""
    if with_sign:
        return f"{signed(estimate.low)} to {signed(estimate.high)}"
    return f"{number(estimate.low)}\N{EN DASH}{number(estimate.high)}"


def interval_phrase(estimate: Estimate, *, with_sign: bool = False) -> str:
    """Write an interval with its level, for sentences and tooltips."""
    text = interval(estimate, with_sign=with_sign)
    return f"{LEVEL:.0%} interval {text}" if text else "no interval"


def finite(value: float) -> float | None:
    """Return a value, None where it is absent."""
    return value if math.isfinite(value) else None
