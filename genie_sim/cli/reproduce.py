"""The command ``reproduce``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli import terminal
from genie_sim.cli.arguments import COUNT, PATH, jobs_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.option("--quick", is_flag=True, help="Two seeds: a coarse answer, in a minute on two cores.")
@click.option(
    "--seeds", type=COUNT, metavar="N", help="So many seeds, from 1 on; default: the assumptions'."
)
@jobs_option
@click.option("--out", type=PATH, default="results/reproduce", help="The folder that gets it.")
def reproduce(*, quick: bool, seeds: int | None, jobs: int | None, out: Path) -> None:
    """Run the paper's evaluation: its table and its five figures.

    Runs are kept in the folder OUT.runs: one that was interrupted goes on from there.
    """
    from genie_sim import api
    from genie_sim.paper import printed
    from genie_sim.report import template

    with (
        ProgressBar(unit="runs") as progress,
        terminal.resumable(out.with_name(f"{out.name}.runs")),
    ):
        result = api.reproduce(out, quick=quick, seeds=seeds, jobs=jobs, progress=progress)
    click.echo(printed.text(result.rows, terminal.width()))
    click.echo(f"Results: {out}\nFigures: {out / 'figures'}")
    click.echo(f"Report:  {out / template.NAME}")
