"""The command ``table``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli import completion
from genie_sim.cli.arguments import (
    changed_option,
    listed,
    metrics_option,
    own_code_option,
    results_argument,
    table_format_option,
)


@click.command()
@results_argument
@table_format_option
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these; differences are from the first.",
)
@metrics_option
@changed_option
@own_code_option
def table(
    *,
    folders: tuple[Path, ...],
    format: str,
    methods: str | None,
    metrics: str | None,
    allow_changed: bool,
) -> None:
    """Print the numbers of results as a table for a paper.

    LaTeX needs the packages booktabs and siunitx.

    \b
    genie-sim table results/3car_hetero-65c23e86c242 --format latex
    """
    from genie_sim.cli import outputs

    names, rows = listed("--methods", methods), listed("--metrics", metrics)
    click.echo(outputs.table(folders, format, names, allow_changed, rows), nl=False)
