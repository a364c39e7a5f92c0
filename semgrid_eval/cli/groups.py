"""Groups of commands that are listed and completed from a table, so that a command is imported only to be used."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from semgrid_eval.errors import InputError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

Table = Callable[[], Mapping[str, str]]
_INVOKED = f"{__name__}.invoked"


def option_of(error: InputError, ctx: click.Context) -> str | None:
    """Return the option of the command that was invoked, as it is typed, that an error of no file is of, if it is."""
    name = (error.field or "").partition(".")[0]  # what follows is a place in its value
    option, command = f"--{name.replace('_', '-')}", ctx.meta.get(_INVOKED)
    is_option = command is not None and any(option in each.opts for each in command.params)
    return option if error.path is None and is_option else None


class TableGroup(click.Group):
    """A group whose `table` has a line of `--help` for each command, by name; `load` imports one of them."""

    def __init__(
        self,
        *given: Any,  # noqa: ANN401 - of any group
        table: Table,
        load: Callable[[str], click.Command],
        **options: Any,  # noqa: ANN401 - of any group
    ) -> None:
        super().__init__(*given, **options)
        self._table, self._load = table, load

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of the table."""
        return list(self._table())

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command, or return None where there is none of this name."""
        return self._load(cmd_name) if cmd_name in self._table() else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that the first word names; one that does not exist is told which was meant."""
        name = args[0]
        if name not in self._table() and not ctx.resilient_parsing:
            from semgrid_eval.faults import not_one_of  # which needs yaml

            ctx.fail(f"command {not_one_of(name, self._table())}")
        found = super().resolve_command(ctx, args)
        ctx.meta[_INVOKED] = found[1]
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table as the section of commands."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self._table().items()))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> "list[CompletionItem]":
        """Complete the name of a command, or an option of the group."""
        from click.shell_completion import CompletionItem

        named = [(name, text) for name, text in self._table().items() if name.startswith(incomplete)]
        options = click.Command.shell_complete(self, ctx, incomplete)
        return [CompletionItem(name, help=text) for name, text in named] + options
