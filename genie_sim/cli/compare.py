"""The command ``compare``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.text import one_line
from genie_sim.cli.arguments import (
    PATH,
    changed_option,
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
@changed_option
@own_code_option
def compare(
    *,
    folders: tuple[Path, ...],
    methods: str | None,
    metrics: str | None,
    labels: tuple[str, ...],
    format: str,
    out: Path | None,
    allow_changed: bool,
) -> None:
    """Compare results, seed by seed.

    Of one result alone, its methods are compared. Seeds that not all results have are left out; a
    line says so.
    """
    from genie_sim.analysis import compare_tables, registry, renderers
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.analysis.seed_runs import load
    from genie_sim.analysis.verdict import verdicts
    from genie_sim.report import comparison

    renderers.checked(format)
    runs = [load(folder, allow_changed=allow_changed) for folder in folders]
    rows = registry.checked(
        listed("--metrics", metrics),
        (metric.metric for run in runs for metric in run.measured),
    )
    compared = compare_runs(runs, listed("--methods", methods), labels, rows)
    click.echo(compare_tables.text(compared, format), nl=False)
    if format == "markdown":
        click.echo()
        for sentence in verdicts(compared):
            click.echo(one_line(sentence))
        click.echo(compare_tables.about(compared))
        for path, values in compared.settings.items():
            click.echo(one_line(f"{path}: {' | '.join(values)}"))
    if out is not None:
        click.echo(f"Report: {comparison.write(compared, out)}", err=format != "markdown")
