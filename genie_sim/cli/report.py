"""The command ``report``. Everything heavy is imported after the arguments are parsed."""

from collections.abc import Callable
from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli import terminal
from genie_sim.cli.arguments import PATH, changed_option, own_code_option


@click.command()
@click.argument("folder", type=PATH, help="A result folder of 'run' or 'reproduce'.")
@click.option(
    "--start", default="0 s", help="Where the replay of a long run begins, such as '60 s'."
)
@click.option("--out", type=PATH, help="The page to write; default: report.html in the folder.")
@changed_option
@own_code_option
def report(
    *,
    folder: Path,
    start: str,
    out: Path | None,
    allow_changed: bool,
) -> None:
    """Write one HTML page about the results in a folder."""
    from genie_sim.base import units

    try:
        start_ns = units.duration_ns(start)
    except ValueError as error:
        raise UserError(f"--start: {error}") from error
    from genie_sim.analysis.seed_runs import is_seeds_folder
    from genie_sim.paper import page as evaluation
    from genie_sim.record import results
    from genie_sim.report import comparison, html_page, template
    from genie_sim.study import printed

    path = out if out is not None else folder / terminal.PAGE
    page: Callable[[Path, bool], str] | None = None
    if (folder / "verdicts.json").is_file():
        page = evaluation.page
    elif is_seeds_folder(folder):
        page = comparison.seeds_page_of
    elif (folder / "sweep.json").is_file():
        page = printed.page_of
    if page is None:
        html_page.write(path, results.load(folder, allow_changed=allow_changed), start_ns)
    elif start_ns:
        raise UserError(
            f"--start: {folder} holds no single run; only the page of a run has a replay"
        )
    else:
        template.write(path, page(folder, allow_changed))
    click.echo(f"Report: {path}")
