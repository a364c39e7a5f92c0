"""Fresh errors: who knows the exact world, and of the recording's errors only how such errors are."""

from semgrid_eval.models.votes import Drawn, DrawSettings


class FreshErrors(Drawn):
    """The likeliest class of each cell, over draws of new errors on the exact target: what is measured on average."""

    continued = False

    @classmethod
    def in_words(cls, settings: DrawSettings) -> str:
        """Say what it knows."""
        return f"exact world, {settings.draws} draws of new errors, likeliest class"
