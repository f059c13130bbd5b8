"""The command ``compare``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.text import one_line
from genie_sim.cli.arguments import (
    PATH,
    labels_option,
    listed,
    metrics_option,
    own_code_option,
    shown_methods_option,
    table_format_option,
)


@click.command()
@click.argument(
    "folders",
    nargs=-1,
    required=True,
    type=PATH,
    help="Result folders, the one to compare with first.",
)
@shown_methods_option
@metrics_option
@labels_option
@table_format_option
@click.option("--out", type=PATH, help="Also write a page, figures and tables into this folder.")
@own_code_option
def compare(
    *,
    folders: tuple[Path, ...],
    methods: str | None,
    metrics: str | None,
    labels: tuple[str, ...],
    format: str,
    out: Path | None,
) -> None:
    """Compare results, seed by seed.

    Of one result alone, each method is compared with the best baseline of each metric, or, with
    --methods, with the first. Seeds that not all results have are left out; a line says so.
    """
    from genie_sim import api
    from genie_sim.analysis import compare_tables, renderers

    renderers.checked(format)
    comparison = api.compare(
        *folders,
        methods=listed("--methods", methods),
        labels=labels,
        metrics=listed("--metrics", metrics),
    )
    click.echo(comparison.text(format), nl=False)
    if format == "markdown":
        click.echo()
        for sentence in comparison.verdicts:
            click.echo(one_line(sentence))
        click.echo(compare_tables.about(comparison.compared))
        for path, values in comparison.compared.settings.items():
            click.echo(one_line(f"{path}: {' | '.join(values)}"))
    if out is not None:
        click.echo(f"Report: {comparison.report(out)}", err=format != "markdown")
