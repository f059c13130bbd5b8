"""The command ``reproduce``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli import terminal
from genie_sim.cli.arguments import COUNT, PATH, jobs_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.option("--quick", is_flag=True, help="A coarse answer in under a minute.")
@click.option(
    "--seeds", type=COUNT, metavar="N", help="So many seeds, from 1 on; default: the assumptions'."
)
@jobs_option
@click.option(
    "--reading",
    help="One reading of the paper, or a file of your own; default: all that there are.",
)
@click.option("--out", type=PATH, default="results/reproduce", help="The folder that gets it.")
def reproduce(
    *,
    quick: bool,
    seeds: int | None,
    jobs: int | None,
    reading: str | None,
    out: Path,
) -> None:
    """Run the paper's evaluation: figures and verdicts."""
    from genie_sim.paper import verdict_table
    from genie_sim.paper.reproduce import reproduce as run_evaluation

    with ProgressBar(unit="runs") as progress:
        result = run_evaluation(
            out,
            quick=quick,
            seeds=seeds,
            workers=jobs,
            progress=progress,
            reading=reading,
        )
    click.echo(verdict_table.text(verdict_table.read_rows(result.folder), terminal.width()))
    click.echo(
        f"Results: {result.folder} ({result.wall_time_s:.0f} s)\n"
        f"Figures: {result.folder / 'figures'}"
    )
    click.echo(f"Report:  {result.folder / terminal.PAGE}")
