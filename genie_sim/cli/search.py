"""The command ``search``. Everything heavy is imported after the arguments are parsed."""

from contextlib import closing
from pathlib import Path
from typing import Any

import click

from genie_sim.cli import completion
from genie_sim.cli.arguments import (
    COUNT,
    PATH,
    jobs_option,
    scheduler_option,
    set_option,
)
from genie_sim.cli.terminal import ProgressBar, resumable


@click.command()
@click.argument(
    "search",
    help="A search file or a scenario, or the name of one that comes with genie-sim.",
    shell_complete=completion.searches,
)
@click.option(
    "--methods",
    metavar="A,B,...",
    help="Only these are tuned, each on the same budget: names or files of spaces.",
)
@set_option
@click.option("--maximize", multiple=True, metavar="METRIC", help="An objective. Repeatable.")
@click.option("--minimize", multiple=True, metavar="METRIC", help="An objective. Repeatable.")
@click.option(
    "--subject-to",
    multiple=True,
    metavar="CONSTRAINT",
    help="Such as 'ghost_share <= 0.3'. Repeatable.",
)
@click.option("--points", type=COUNT, help="How many points are tried of each method.")
@click.option("--seed", type=click.IntRange(min=0), help="Root of the search's own random draws.")
@click.option("--out", type=PATH, default="results", help="The folder that gets the search's.")
@jobs_option
@scheduler_option
def search(
    *,
    search: str,
    methods: str | None,
    set_: tuple[str, ...],
    maximize: tuple[str, ...],
    minimize: tuple[str, ...],
    subject_to: tuple[str, ...],
    points: int | None,
    seed: int | None,
    out: Path,
    jobs: int | None,
    scheduler: str | None,
) -> None:
    """Search for the best settings. What has been done is not done again.

    A setting that --set changes is not searched.

    \b
    genie-sim search 3car_hetero
    genie-sim search where_it_pays --methods genie,sim_lru,remote
    genie-sim search mine.yaml --subject-to 'ghost_share <= 0.3' --points 500
    """
    changes: dict[str, Any] = {}
    if set_:
        from genie_sim.study.search_design import fixed_settings

        changes["set"] = fixed_settings(set_)
    if maximize or minimize:
        changes["objectives"] = {"maximize": list(maximize), "minimize": list(minimize)}
    if subject_to:
        changes["subject_to"] = list(subject_to)
    given = (("points", points), ("seed", seed))
    changes |= {key: value for key, value in given if value is not None}
    from genie_sim.base import parallel
    from genie_sim.study.search_design import load
    from genie_sim.study.tasks import DaskWorkers, LocalWorkers

    design = load(search, methods.split(",") if methods else (), changes)
    from genie_sim.study.search import Search

    with (
        closing(
            LocalWorkers(jobs or parallel.workers_here())
            if scheduler is None
            else DaskWorkers(scheduler)
        ) as workers,
        ProgressBar(unit="points") as progress,
    ):
        work = Search(design, out, workers)
        with resumable(work.folder):
            work.run(progress)
            _, picks = work.finish(progress)
    for pick in picks:
        click.echo(pick.text)
    click.echo(f"\nHeld-out results: {work.folder / 'designs.csv'}")
    click.echo(f"To run a design: genie-sim run {work.folder / 'designs' / 'most_accurate.yaml'}")
    click.echo(f"Figures: {work.folder / 'figures'}")
