"""The `semgrid-eval` command and the one place where errors become exit codes."""

import importlib
import sys
from typing import Any

import click

from semgrid_eval import __version__
from semgrid_eval.errors import SemgridError

_COMMANDS = {
    "convert": "semgrid_eval.cli.convert",
    "check": "semgrid_eval.cli.check",
    "segment": "semgrid_eval.cli.segment",
    "grids": "semgrid_eval.cli.grids",
    "run": "semgrid_eval.cli.run",
    "report": "semgrid_eval.cli.report",
    "play": "semgrid_eval.cli.play",
    "demo": "semgrid_eval.cli.demo",
    "bench": "semgrid_eval.cli.bench",
}


class _LazyGroup(click.Group):
    """Imports a command only when it is asked for, so that `--help` and `check` do not wait for torch."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command = importlib.import_module(_COMMANDS[cmd_name]).command
        assert isinstance(command, click.Command)
        return command


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="semgrid-eval")
def cli() -> None:
    """Evaluate short-term prediction on semantic grids, from recorded MCAP logs."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; a user's mistake ends it with one line and exit code 1 or 2."""
    try:
        result: Any = cli.main(args=arguments, standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except SemgridError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(1)
    except (KeyboardInterrupt, click.Abort):
        click.echo("Stopped; the same command goes on from here.", err=True)
        sys.exit(130)
    sys.exit(result if isinstance(result, int) else 0)


if __name__ == "__main__":
    main()
