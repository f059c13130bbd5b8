"""The command ``list``. Everything heavy is imported after the arguments are parsed."""

import sys

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import completion, terminal


@click.command("list")
@click.argument(
    "what",
    required=False,
    shell_complete=completion.kinds,
    help="scenarios, devices, links, ...; without it: all.",
)
def list_(what: str | None) -> None:
    """Show what can be named in a scenario."""
    from genie_sim.cli import catalogue

    if what is not None and what not in catalogue.KINDS:
        raise UserError(unknown("kind of thing to list", what, catalogue.KINDS))
    for kind in [what] if what is not None else catalogue.KINDS:
        if what is None:
            click.echo(f"{kind}:")
        columns = terminal.width() if sys.stdout.isatty() else None
        for line in terminal.listing(catalogue.KINDS[kind](), "" if what else "  ", columns):
            click.echo(line)
