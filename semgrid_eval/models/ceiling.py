"""The ceiling: who knows the exact world, and how the recording's errors stand at the newest input."""

from semgrid_eval.models.votes import Drawn, DrawSettings


class Ceiling(Drawn):
    """The likeliest class of each cell, over draws that continue the recording's errors on the exact target.

    What is measured at the target's time depends on the world there, which is known, and on errors, of which no more
    is known than the inputs could tell. So no model has more cells right on average, but for the chance in a finite
    number of draws; IoU follows closely, though not to the letter.
    """

    bound = "upper"
    continued = True

    @classmethod
    def in_words(cls, settings: DrawSettings) -> str:
        """Say what it knows."""
        return f"exact world, this recording's errors continued in {settings.draws} draws, likeliest class"
