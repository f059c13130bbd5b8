"""The command ``table``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli.arguments import (
    changed_option,
    labels_option,
    listed,
    metrics_option,
    own_code_option,
    results_argument,
    shown_methods_option,
    table_format_option,
)


@click.command()
@results_argument
@table_format_option
@shown_methods_option
@metrics_option
@labels_option
@changed_option
@own_code_option
def table(
    *,
    folders: tuple[Path, ...],
    format: str,
    methods: str | None,
    metrics: str | None,
    labels: tuple[str, ...],
    allow_changed: bool,
) -> None:
    """Print the numbers of results as a table for a paper.

    LaTeX needs the packages booktabs and siunitx.

    \b
    genie-sim table results/3car_hetero-65c23e86c242 --format latex
    """
    from genie_sim.cli.outputs import Results

    results = Results(folders, listed("--methods", methods), labels, allow_changed)
    click.echo(results.table(format, listed("--metrics", metrics)), nl=False)
