"""The command ``list``. Everything heavy is imported after the arguments are parsed."""

import sys

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import terminal


@click.command("list")
@click.argument(
    "what",
    required=False,
    help="scenarios, devices, links, ...; without it: the kinds, and how many of each there are.",
)
def list_(what: str | None) -> None:
    """Show what can be named in a scenario."""
    from genie_sim.cli import catalogue

    if what is None:
        rows = [
            (kind, f"{sum(1 for _ in names())}: genie-sim list {kind}")
            for kind, names in catalogue.KINDS.items()
        ]
    elif what in catalogue.KINDS:
        rows = list(catalogue.KINDS[what]())
    else:
        raise UserError(unknown("kind of thing to list", what, catalogue.KINDS))
    for line in terminal.listing(rows, terminal.width() if sys.stdout.isatty() else None):
        click.echo(line)
