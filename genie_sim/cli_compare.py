"""Commands about results that are there. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path
from typing import Annotated

import typer

from genie_sim.arguments import OwnCodeOption, path_argument, path_option
from genie_sim.errors import UserError, unknown


def compare(
    folders: Annotated[list[str], typer.Argument(help="Result folders, the one to compare with first.")],
    method: Annotated[
        list[str] | None, typer.Option(help="Only this method. Repeatable; the first is compared with.")
    ] = None,
    format: Annotated[str, typer.Option(help="Of the printed table: markdown, csv or latex.")] = "markdown",
    out: Annotated[Path | None, path_option(help="Also write a page, figures and tables into this folder.")] = None,
    allow_own_code: OwnCodeOption = False,
) -> None:
    """Compare results that saw the same frames.

    Of one result alone, its methods are compared.
    """
    from genie_sim.analysis import text_table
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.recording import results
    from genie_sim.report import comparison

    text_table.checked(format)
    made = compare_runs([results.load(folder) for folder in folders], method or ())
    typer.echo(comparison.text(made, format), nl=False)
    if format == "markdown":
        typer.echo(f"\n{comparison.note(made)}")
        for path, values in made.settings.items():
            typer.echo(f"{path}: {' | '.join(values)}")
    if out is not None:
        typer.echo(f"Report: {comparison.write(made, out)}", err=format != "markdown")


def figures(
    folder: Annotated[Path, path_argument(help="A result folder of 'run'.")],
    format: Annotated[str, typer.Option(metavar="A,B,...", help="svg, png, pdf, or several.")] = "svg",
    width: Annotated[
        str | None, typer.Option(help="Of a printed 'column' (3.5 in) or 'page' (7.16 in); default: what fits each.")
    ] = None,
    out: Annotated[Path | None, path_option(help="Where to; default: figures in the result folder.")] = None,
    allow_own_code: OwnCodeOption = False,
) -> None:
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
    typer.echo("\n".join(map(str, paths)))


def table(
    folder: Annotated[Path, path_argument(help="A result folder of 'run'.")],
    format: Annotated[str, typer.Option(help="markdown, latex or csv (every metric, all digits).")] = "markdown",
    allow_own_code: OwnCodeOption = False,
) -> None:
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
        typer.echo(text_table.exact(names, map(astuple, run.measured)), nl=False)
    else:
        titles = {method.name: method.title for method in run.methods}
        headings, rows = summary.cells(run.measured, titles)
        typer.echo(text_table.rounded(format, headings, rows, "l" + "r" * (len(headings) - 1)), nl=False)
