"""The command ``sweep``. Everything heavy is imported after the arguments are parsed."""

from contextlib import closing
from pathlib import Path

import click

from genie_sim.cli import arguments, completion, terminal
from genie_sim.cli.arguments import (
    PATH,
    backend_option,
    jobs_option,
    label_option,
    scheduler_option,
)
from genie_sim.cli.run import print_results
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument(
    "sweep",
    help="A sweep file, or the name of one that comes with genie-sim.",
    shell_complete=completion.sweeps,
)
@click.option(
    "--out", type=PATH, default="results", help="The folder that gets the sweep's folder."
)
@jobs_option
@backend_option
@scheduler_option
@click.option(
    "--shard", default="1/1", metavar="I/N", help="Only this part of the runs, for job arrays."
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these, at every point.",
)
@click.option("--seeds", metavar="N|A,B,...", help="So many seeds, or these; default: the sweep's.")
@label_option
def sweep(
    *,
    sweep: str,
    out: Path,
    jobs: int | None,
    backend: str,
    scheduler: str | None,
    shard: str,
    methods: str | None,
    seeds: str | None,
    label: str,
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again."""
    part = arguments.shard(shard)
    names, numbers = arguments.listed("--methods", methods), arguments.seeds(seeds)
    if (backend == "dask") != (scheduler is not None):
        raise click.BadParameter("--backend dask and --scheduler ADDRESS belong together")
    from genie_sim.analysis.seed_runs import load
    from genie_sim.base import parallel
    from genie_sim.record.results import checked_label
    from genie_sim.study.study import Study
    from genie_sim.study.tasks import DaskWorkers, LocalWorkers

    label = checked_label(label, "--label")
    with ProgressBar(unit="points") as progress:
        work = Study.load(sweep, out, progress, seeds=numbers, methods=names, label=label)
    workers = (
        LocalWorkers(jobs or parallel.workers_here())
        if scheduler is None
        else DaskWorkers(scheduler)
    )
    with (
        closing(workers),
        ProgressBar(unit="runs") as progress,
        terminal.resumable(work.folder),
    ):
        work.run(workers, part, progress)
    done = work.finish()
    if done.complete and not work.design.axes:
        print_results(load(done.folder), page=True, figures=False)
    elif done.complete:
        click.echo(
            f"{done.points:,} points, {done.runs:,} runs\n"
            f"Table: {done.folder / 'table.csv'} (and .parquet)"
        )
        click.echo(f"Figures: {done.folder / 'figures'}\nReport:  {done.folder / terminal.PAGE}")
    else:
        click.echo(
            f"{done.done:,} of {done.runs:,} runs are in {done.folder}; "
            "the last shard makes the table"
        )
