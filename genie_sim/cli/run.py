"""The command ``run``. Everything heavy is imported after the arguments are parsed."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import allow_own_code
from genie_sim.base.text import one_line
from genie_sim.cli import arguments, terminal
from genie_sim.cli.arguments import (
    COUNT,
    PATH,
    label_option,
    methods_option,
    metrics_option,
    seeds_option,
    set_option,
)
from genie_sim.cli.terminal import ProgressBar

if TYPE_CHECKING:
    from genie_sim.analysis.seed_runs import SeedRuns
    from genie_sim.record.results import Run


@click.command()
@click.argument(
    "scenario",
    help="A scenario file, or the name of one that comes with genie-sim.",
)
@set_option
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Root of all random streams; default: the scenario's.",
)
@methods_option
@seeds_option
@click.option(
    "--jobs", type=COUNT, help="With --seeds: processes on this machine; default: one a core."
)
@label_option
@click.option("--out", type=PATH, default="results", help="The folder that gets the result folder.")
@click.option(
    "--no-report",
    is_flag=True,
    help="Make no report.html; an earlier one of the same runs and label is kept.",
)
@click.option("--figures", is_flag=True, help="Draw the figures as well, as SVG.")
@click.option("--all", "all_rows", is_flag=True, help="Print all rows of the table.")
@metrics_option
def run(
    *,
    scenario: str,
    set_: tuple[str, ...],
    seed: int | None,
    methods: str | None,
    seeds: str | None,
    jobs: int | None,
    label: str,
    out: Path,
    no_report: bool,
    figures: bool,
    all_rows: bool,
    metrics: str | None,
) -> None:
    """Simulate a scenario under each of its methods.

    Those are local, remote and Genie, unless it says otherwise.

    \b
    genie-sim run 3car_hetero
    genie-sim run 3car_hetero --set cars[0].device=orin_nano --set genie.eviction=lru
    genie-sim run mine.yaml --seed 7 --out lab
    genie-sim run mine.yaml --methods local,genie
    genie-sim run 3car_hetero --seeds 5
    """
    from genie_sim.base import files

    allow_own_code()
    several = arguments.seeds(seeds)
    if seed is not None and several is not None:
        raise UserError("--seed and --seeds: give one of them")
    if jobs is not None and several is None:
        raise UserError("--jobs: has no effect without --seeds")
    # the metrics that are named; none of them: all; None: a few that the table chooses
    rows = arguments.listed("--metrics", metrics) if metrics is not None or all_rows else None
    if rows and all_rows:
        raise UserError("--all and --metrics: give one of them")

    files.find(files.SCENARIO, scenario)  # a wrong name is reported before the heavy imports
    from genie_sim import api
    from genie_sim.analysis import registry
    from genie_sim.record.results import checked_label
    from genie_sim.runs import prepare
    from genie_sim.scenario.reading import load_scenario

    names = arguments.listed("--methods", methods)
    loaded = load_scenario(scenario, set_, seed, methods=names, methods_from=f"--methods {methods}")
    registry.checked(rows or (), loaded.metrics)
    label = checked_label(label, "--label")
    if own := loaded.own_classes():
        click.echo(f"{loaded.name} runs code of its own: {', '.join(own)}")
    for note in prepare.notes(loaded):
        click.echo(textwrap.fill(note, min(terminal.width(), 100)))
    shown: dict[str, Any] = {"label": label, "report": not no_report, "figures": figures}
    result: Run | SeedRuns
    if several is None:
        with ProgressBar("s of all methods") as progress:
            result = api.run(loaded, out=out, progress=progress, **shown)
    else:
        with ProgressBar("runs") as progress, terminal.resumable(out):
            result = api.run_seeds(
                loaded, seeds=several, out=out, jobs=jobs, progress=progress, **shown
            )
    print_results(result, page=not no_report, figures=figures, rows=rows)


def print_results(
    result: "Run | SeedRuns", *, page: bool, figures: bool, rows: list[str] | None = None
) -> None:
    """Prints the table of a run, or of several seeds, and where the results are.

    Parameters
    ----------
    result : Run or SeedRuns
        What ran, in its folder.
    page, figures : bool
        Whether the folder has a page, and figures.
    rows : list of str, optional
        The metrics that are printed, none for all; by default ``screen.text`` chooses.
    """
    from genie_sim.analysis import screen
    from genie_sim.analysis.compare import compared
    from genie_sim.analysis.verdict import verdicts
    from genie_sim.report import template

    folder, columns = result.folder, min(terminal.width(), 100)
    assert folder is not None
    click.echo(screen.text(result, columns, rows), nl=False)
    for sentence in verdicts(compared([result], metrics=rows or ())):
        click.echo(textwrap.fill(one_line(sentence), columns, subsequent_indent="  "))
    click.echo(f"Results: {folder} (all tables, with intervals: summary.md)")
    click.echo(f"Figures: {folder / 'figures' if figures else f'genie-sim figures {folder}'}")
    if page:
        click.echo(f"Report:  {folder / template.NAME}")
