"""Groups that say which command may have been meant, and numbers that say what they are."""

import click

from semgrid_eval.faults import not_one_of


class Whole(click.IntRange):
    """A whole number within limits."""

    name = "integer"


class Number(click.FloatRange):
    """A number within limits."""

    name = "number"


class HintingGroup(click.Group):
    """A group of commands that knows what a misspelt one may have meant."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that is asked for; a UsageError names those that there are."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            ctx.fail(f"command {not_one_of(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)
