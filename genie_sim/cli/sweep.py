"""The command ``sweep``. Everything heavy is imported after the arguments are parsed."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import allow_own_code
from genie_sim.cli import arguments, terminal
from genie_sim.cli.arguments import (
    PATH,
    jobs_option,
    label_option,
    methods_option,
    seeds_option,
    set_option,
)
from genie_sim.cli.run import print_results
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument(
    "what",
    metavar="SWEEP|SCENARIO",
    help="A sweep file or, with --axis, a scenario; or the name of one that comes with genie-sim.",
)
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="PATH=A,B,...",
    help="Vary a field of a scenario, such as fleet.cars=10,20. Repeatable.",
)
@set_option
@methods_option
@seeds_option
@click.option(
    "--out", type=PATH, default="results", help="The folder that gets the sweep's folder."
)
@jobs_option
@click.option(
    "--shard", default="1/1", metavar="I/N", help="Only this part of the runs, for job arrays."
)
@label_option
def sweep(
    *,
    what: str,
    axes: tuple[str, ...],
    set_: tuple[str, ...],
    methods: str | None,
    seeds: str | None,
    out: Path,
    jobs: int | None,
    shard: str,
    label: str,
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again.

    \b
    genie-sim sweep where_it_pays
    genie-sim sweep fleet_30 --axis fleet.cars=10,20,40 --axis fleet.link=wifi,lte --seeds 3
    """
    allow_own_code()
    part = arguments.shard(shard)
    names, numbers = arguments.listed("--methods", methods), arguments.seeds(seeds)
    from genie_sim import api
    from genie_sim.analysis.seed_runs import SeedRuns
    from genie_sim.record.results import checked_label
    from genie_sim.study.study import UnfinishedError

    try:
        with ProgressBar("") as progress, terminal.resumable(out):
            result: Any = api.sweep(
                what,
                _levels(axes) if axes else None,
                set_,
                seeds=numbers,
                methods=names,
                label=checked_label(label, "--label"),
                jobs=jobs,
                shard=part,
                out=out,
                progress=progress,
            )
    except UnfinishedError as rest:
        click.echo(str(rest))
        return
    if isinstance(result, SeedRuns):
        print_results(result, page=True, figures=False)
        return
    click.echo(f"{result.about['points']:,} points, {result.about['runs']:,} runs")
    click.echo(f"Table: {result.folder / 'table.csv'} (and .parquet)")
    click.echo(f"Figures: {result.folder / 'figures'}")


def _levels(axes: Sequence[str]) -> dict[str, Any]:
    """The values of each setting that varies. Raises ``UserError``."""
    from genie_sim.scenario.yaml_input import parse

    values: dict[str, Any] = {}
    for text in axes:
        setting, equals, listed = (part.strip() for part in text.partition("="))
        if not equals or not setting or not listed:
            raise UserError(f"--axis {text}: must be path=A,B,... such as fleet.cars=10,20")
        if setting == "seed":
            raise UserError(f"--axis {text}: write --seeds {listed}")
        if setting in values:
            raise UserError(f"--axis {text}: {setting} is varied already")
        values[setting] = parse(f"[{listed}]", f"--axis {text}")
    return values
