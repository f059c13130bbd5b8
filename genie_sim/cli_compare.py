"""The command ``genie-sim compare``. Everything heavy is imported after the arguments are parsed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from genie_sim.arguments import OwnCodeOption, path_option
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
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.recording import results
    from genie_sim.report import comparison

    if format not in comparison.FORMATS:
        raise UserError(f"--format: {unknown('format', format, comparison.FORMATS)}")
    made = compare_runs([results.load(folder) for folder in folders], method or ())
    typer.echo(comparison.text(made, format), nl=False)
    if format == "markdown":
        typer.echo(f"\n{comparison.note(made)}")
        for path, values in made.settings.items():
            typer.echo(f"{path}: {' | '.join(values)}")
    if out is not None:
        typer.echo(f"Report: {comparison.write(made, out)}", err=format != "markdown")
