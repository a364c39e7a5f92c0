"""How much longer the interval of few recordings has to be than that of its resamples: Student's distribution."""

from functools import cache
from math import cos, pi, sin, sqrt
from statistics import NormalDist

_STEPS = 80  # of halving, down to the last digit


@cache
def stretch(units: int, level: float) -> float:
    """Return by how much the distances from the middle of resamples of `units` recordings to their ends must grow.

    Resamples vary by (n - 1) / n of the variance that is estimated without bias, and their quantiles are those of a
    normal distribution where n recordings allow those of Student's with n - 1 degrees of freedom. With both put right,
    the interval of a mean of normal values is Student's. After Hesterberg 2015, "What Teachers Should Know About the
    Bootstrap", who moves the levels of the quantiles outwards instead: with three or four recordings, no resample lies
    so far out.
    """
    return sqrt(units / (units - 1)) * student_quantile(units - 1, level) / NormalDist().inv_cdf((1 + level) / 2)


def student_quantile(freedom: int, level: float) -> float:
    """Return the t below which |t| lies with a probability of `level`, by degrees of freedom."""
    low, high = 0.0, pi / 2
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if _within(middle, freedom) < level else (low, middle)
    return sqrt(freedom) * sin(low) / cos(low)


def _within(angle: float, freedom: int) -> float:
    """Return the probability of |t| below sqrt(freedom) tan(angle): Abramowitz and Stegun 26.7.3 and 26.7.4."""
    odd = freedom % 2
    term = cos(angle) if odd else 1.0
    total = term if freedom > 1 else 0.0
    for power in range(2 + odd, freedom - 1, 2):
        term *= (power - 1) / power * cos(angle) ** 2
        total += term
    return (angle + sin(angle) * total) * 2 / pi if odd else sin(angle) * total
