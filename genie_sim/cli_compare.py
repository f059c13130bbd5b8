"""Commands about results that are there. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.arguments import PATH, own_code_option
from genie_sim.errors import UserError, unknown


@click.command()
@click.argument(
    "folders", nargs=-1, required=True, help="Result folders, the one to compare with first."
)
@click.option(
    "--method", multiple=True, help="Only this method. Repeatable; the first is compared with."
)
@click.option("--format", default="markdown", help="Of the printed table: markdown, csv or latex.")
@click.option("--out", type=PATH, help="Also write a page, figures and tables into this folder.")
@own_code_option
def compare(
    folders: tuple[str, ...], method: tuple[str, ...], format: str, out: Path | None
) -> None:
    """Compare results that saw the same frames.

    Of one result alone, its methods are compared.
    """
    from genie_sim.analysis import text_table
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.recording import results
    from genie_sim.report import comparison

    text_table.checked(format)
    made = compare_runs([results.load(folder) for folder in folders], method)
    click.echo(comparison.text(made, format), nl=False)
    if format == "markdown":
        click.echo(f"\n{comparison.note(made)}")
        for path, values in made.settings.items():
            click.echo(f"{path}: {' | '.join(values)}")
    if out is not None:
        click.echo(f"Report: {comparison.write(made, out)}", err=format != "markdown")


@click.command()
@click.argument("folder", type=PATH, help="A result folder of 'run'.")
@click.option("--format", default="svg", metavar="A,B,...", help="svg, png, pdf, or several.")
@click.option(
    "--width", help="Of a printed 'column' (3.5 in) or 'page' (7.16 in); default: what fits each."
)
@click.option("--out", type=PATH, help="Where to; default: figures in the result folder.")
@own_code_option
def figures(folder: Path, format: str, width: str | None, out: Path | None) -> None:
    """Draw the figures of a run for a paper.

    A title, and which run it is, stand in the file and not in the picture. PDF has its fonts embedded.

    \b
    genie-sim figures results/3car_hetero-65c23e86c242 --format svg,pdf
    """
    from genie_sim.analysis import figures as of_runs
    from genie_sim.analysis import style
    from genie_sim.recording import provenance, results

    formats = list(dict.fromkeys(format.split(",")))
    for one in formats:
        if one not in of_runs.FORMATS:
            raise UserError(f"--format: {unknown('format', one, of_runs.FORMATS)}")
    if width not in (None, *style.WIDTHS):
        raise UserError(f"--width: {unknown('width', str(width), style.WIDTHS)}")
    run = results.load(folder)
    with provenance.of_this_version(folder):
        paths = of_runs.write(run, folder / "figures" if out is None else out, formats, width)
    click.echo("\n".join(map(str, paths)))


@click.command()
@click.argument("folder", type=PATH, help="A result folder of 'run'.")
@click.option(
    "--format", default="markdown", help="markdown, latex or csv (every metric, all digits)."
)
@own_code_option
def table(folder: Path, format: str) -> None:
    """Print the numbers of a run as a table for a paper.

    \b
    genie-sim table results/3car_hetero-65c23e86c242 --format latex
    """
    from dataclasses import astuple, fields

    from genie_sim.analysis import summary, text_table
    from genie_sim.recording import results

    text_table.checked(format)
    run = results.load(folder)
    if format == "csv":
        names = [field.name for field in fields(results.Metric)]
        click.echo(text_table.exact(names, map(astuple, run.measured)), nl=False)
    else:
        titles = {method.name: method.title for method in run.methods}
        headings, rows = summary.cells(run.measured, titles)
        click.echo(
            text_table.rounded(format, headings, rows, "l" + "r" * (len(headings) - 1)), nl=False
        )
