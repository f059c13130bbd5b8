"""The command ``table``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli.arguments import (
    PATH,
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
@click.option("--out", type=PATH, help="A file for the table, instead of printing it.")
@own_code_option
def table(
    *,
    folders: tuple[Path, ...],
    format: str,
    methods: str | None,
    metrics: str | None,
    labels: tuple[str, ...],
    out: Path | None,
) -> None:
    """Print the numbers of results as a table for a paper.

    LaTeX needs the packages booktabs and array.

    \b
    genie-sim table results/3car_hetero-65c23e86c242 --format latex --out latency.tex
    """
    from genie_sim import kinds
    from genie_sim.analysis import renderers

    renderers.checked(format)
    result = kinds.shown(folders, listed("--methods", methods), labels)
    text = result.text(format, listed("--metrics", metrics))
    if out is None:
        click.echo(text, nl=False)
        return
    renderers.write(out, text, format)
    click.echo(f"Table: {out}")
