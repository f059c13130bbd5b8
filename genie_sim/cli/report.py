"""The command ``report``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli.arguments import PATH, own_code_option


@click.command()
@click.argument("folder", type=PATH, help="A result folder of any kind.")
@click.option(
    "--start", default="0 s", help="Where the replay of a long run begins, such as '60 s'."
)
@click.option("--out", type=PATH, help="The page to write; default: report.html in the folder.")
@own_code_option
def report(
    *,
    folder: Path,
    start: str,
    out: Path | None,
) -> None:
    """Write one HTML page about the results in a folder."""
    from genie_sim.base import units

    try:
        start_ns = units.duration_ns(start)
    except ValueError as error:
        raise UserError(f"--start: {error}") from error
    from genie_sim import kinds
    from genie_sim.report import template

    path = out if out is not None else folder / template.NAME
    template.PAGE.check(path)  # before anything is drawn
    result = kinds.load(folder)
    if isinstance(result, kinds.Run):
        page = result.page(start_ns)
    elif start_ns:
        raise UserError(
            f"--start: {folder} holds no single run; only the page of a run has a replay"
        )
    else:
        page = result.page()
    template.write(path, page)
    click.echo(f"Report: {path}")
