"""Numbers that say what they are."""

import click


class Whole(click.IntRange):
    """A whole number within limits."""

    name = "integer"


class Number(click.FloatRange):
    """A number within limits."""

    name = "number"
