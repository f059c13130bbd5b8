"""The command ``compare``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.text import one_line
from genie_sim.cli import completion
from genie_sim.cli.arguments import (
    PATH,
    changed_option,
    listed,
    own_code_option,
    table_format_option,
)


@click.command()
@click.argument(
    "folders", nargs=-1, required=True, help="Result folders, the one to compare with first."
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these; of one result, the first is compared with.",
)
@click.option("--labels", metavar="A,B,...", help="What the settings are called, in their order.")
@table_format_option
@click.option("--out", type=PATH, help="Also write a page, figures and tables into this folder.")
@changed_option
@own_code_option
def compare(
    *,
    folders: tuple[str, ...],
    methods: str | None,
    labels: str | None,
    format: str,
    out: Path | None,
    allow_changed: bool,
) -> None:
    """Compare results that saw the same frames.

    Of one result alone, its methods are compared.
    """
    from genie_sim.analysis import compare_tables, renderers
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.analysis.seed_runs import load
    from genie_sim.analysis.verdict import verdicts
    from genie_sim.report import comparison

    renderers.checked(format)
    runs = [load(folder, allow_changed=allow_changed) for folder in folders]
    compared = compare_runs(runs, listed("--methods", methods), listed("--labels", labels))
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
