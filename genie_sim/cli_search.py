"""The command ``search``. Everything heavy is imported after the arguments are parsed."""

import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import click

from genie_sim import arguments, completion, terminal
from genie_sim.arguments import COUNT, PATH, backend_option, jobs_option, scheduler_option
from genie_sim.terminal import Progress


@click.command()
@click.argument(
    "search",
    help="A search file or a scenario, or the name of one that comes with genie-sim.",
    shell_complete=completion.searches,
)
@click.option(
    "--methods",
    metavar="A,B,...",
    help="Which methods are tuned, each on the same budget: names or files of spaces.",
)
@click.option(
    "--set",
    "set_",
    multiple=True,
    metavar="PATH=VALUE",
    shell_complete=completion.setting_paths,
    help="Fix a setting, which is then not searched. Repeatable.",
)
@click.option("--maximize", multiple=True, metavar="METRIC", help="An objective. Repeatable.")
@click.option("--minimize", multiple=True, metavar="METRIC", help="An objective. Repeatable.")
@click.option(
    "--subject-to",
    multiple=True,
    metavar="CONSTRAINT",
    help="Such as 'ghost_share <= 0.3'. Repeatable.",
)
@click.option("--points", type=COUNT, help="How many points are tried of each method.")
@click.option("--seed", type=click.IntRange(min=0), help="Of the search itself.")
@click.option("--out", type=PATH, default="results", help="The folder that gets the search's.")
@click.option(
    "--storage",
    type=click.Choice(("journal", "sqlite")),
    default="journal",
    help="How points are stored in the folder.",
)
@jobs_option
@backend_option
@scheduler_option
@click.option(
    "--shard", default="1/1", metavar="I/N", help="Only this part of the points, for job arrays."
)
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
    storage: str,
    jobs: int | None,
    backend: str,
    scheduler: str | None,
    shard: str,
) -> None:
    """Search the settings that pay. What has been done is not done again.

    \b
    genie-sim search 3car_hetero
    genie-sim search where_it_pays --methods genie,sim_lru,remote
    genie-sim search mine.yaml --subject-to 'ghost_share <= 0.3' --points 500
    """
    part = arguments.shard(shard)
    if (backend == "dask") != (scheduler is not None):
        raise click.BadParameter("--backend dask and --scheduler ADDRESS belong together")
    changes: dict[str, Any] = {}
    if set_:
        from genie_sim.tuning.design import fixed_settings

        changes["set"] = fixed_settings(set_)
    if maximize or minimize:
        changes["objectives"] = {"maximize": list(maximize), "minimize": list(minimize)}
    if subject_to:
        changes["subject_to"] = list(subject_to)
    given = (("points", points), ("seed", seed))
    changes |= {key: value for key, value in given if value is not None}
    from genie_sim import parallel
    from genie_sim.study.tasks import DaskWorkers, LocalWorkers
    from genie_sim.tuning.design import load

    design = load(search, methods.split(",") if methods else (), changes)
    from genie_sim.tuning.search import Search

    work = Search(design, out, storage)
    with (
        closing(
            LocalWorkers(jobs or parallel.workers_here())
            if scheduler is None
            else DaskWorkers(scheduler)
        ) as workers,
        Progress(unit="points") as progress,
    ):
        try:
            work.run(workers, part, progress)
            done = work.finish(workers, progress)
        except KeyboardInterrupt:
            click.echo(f"genie-sim: interrupted; points are kept in {work.folder}", err=True)
            sys.exit(130)
    if not done.complete:
        click.echo(
            f"{done.tried:,} of {done.points:,} points are in {done.folder}; "
            "the last shard makes the report"
        )
        return
    for pick in done.picks:
        click.echo(pick.text)
    click.echo(f"\n{done.points:,} points; held-out results: {done.folder / 'designs.csv'}")
    click.echo(f"To run a design: genie-sim run {done.folder / 'designs' / 'most_accurate.yaml'}")
    if (done.folder / terminal.PAGE).is_file():
        click.echo(f"Figures: {done.folder / 'figures'}\nReport:  {done.folder / terminal.PAGE}")
