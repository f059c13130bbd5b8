"""The command ``sweep``. Everything heavy is imported after the arguments are parsed."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from genie_sim.base.errors import UserError
from genie_sim.cli import arguments, completion, terminal
from genie_sim.cli.arguments import (
    PATH,
    jobs_option,
    label_option,
    methods_option,
    scheduler_option,
    seeds_option,
    set_option,
)
from genie_sim.cli.run import print_results
from genie_sim.cli.terminal import ProgressBar

log = logging.getLogger(__name__)
WRITTEN = "design.yaml"  # beside the results: the sweep that the command line described


@click.command()
@click.argument(
    "what",
    metavar="SWEEP|SCENARIO",
    help="A sweep file or, with --axis, a scenario; or the name of one that comes with genie-sim.",
    shell_complete=completion.sweeps,
)
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="PATH=A,B,...",
    shell_complete=completion.setting_paths,
    help="Vary a field of a scenario, such as fleet.cars=10,20. Repeatable.",
)
@set_option
@methods_option
@seeds_option
@click.option(
    "--out", type=PATH, default="results", help="The folder that gets the sweep's folder."
)
@jobs_option
@scheduler_option
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
    scheduler: str | None,
    shard: str,
    label: str,
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again.

    \b
    genie-sim sweep where_it_pays
    genie-sim sweep fleet_30 --axis fleet.cars=10,20,40 --axis fleet.link=wifi,lte --seeds 3
    """
    if scheduler is not None:
        of_all = ("what", "axes", "set_", "methods", "seeds", "out", "scheduler", "shard", "label")
        arguments.only("with --scheduler", *of_all)
    part = arguments.shard(shard)
    names, numbers = arguments.listed("--methods", methods), arguments.seeds(seeds)
    from genie_sim import kinds
    from genie_sim.base import files, parallel
    from genie_sim.record.results import checked_label
    from genie_sim.study.design import fixed_settings, load_design, read_design
    from genie_sim.study.study import Study
    from genie_sim.study.work import Workers

    label = checked_label(label, "--label")
    settings = fixed_settings(set_)
    if axes:
        described = _described(what, axes, settings, numbers, names)
        design, where = read_design(described, "--axis"), "--axis"
    else:
        _refuse_scenario(what)
        design, where = load_design(what, numbers, settings), str(files.find(files.SWEEP, what))
    with ProgressBar(unit="points") as progress:
        work = Study.of(design, where, out, progress, methods=names, label=label)
    workers = Workers(jobs or parallel.workers_here(), scheduler)
    with (
        ProgressBar(unit="runs") as progress,
        terminal.resumable(work.folder),
    ):
        work.run(workers, part, progress)
    if axes:
        _write_design(work.folder / WRITTEN, described, methods)
    done = work.finish()
    if done.complete and not work.design.axes:
        print_results(kinds.Runs.read(done.folder), page=True, figures=False)
    elif done.complete:
        click.echo(
            f"{done.points:,} points, {done.runs:,} runs\n"
            f"Table: {done.folder / 'table.csv'} (and .parquet)"
        )
        click.echo(f"Figures: {done.folder / 'figures'}")
    else:
        click.echo(
            f"{done.done:,} of {done.runs:,} runs are in {done.folder}; "
            "the last shard makes the table"
        )


def _described(
    scenario: str,
    axes: Sequence[str],
    settings: dict[str, Any],
    seeds: int | list[int] | None,
    methods: Sequence[str],
) -> dict[str, Any]:
    """The sweep that the command line describes, as in a file. Raises ``UserError``."""
    from genie_sim.scenario.yaml_input import parse
    from genie_sim.study.design import sweep_of

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
    return sweep_of(scenario, values, methods, {"set": settings, "seeds": seeds})


def _refuse_scenario(name: str) -> None:
    """Raises ``UserError`` for a scenario without an axis."""
    from genie_sim.base import files
    from genie_sim.study.design import refuse_scenario

    if name not in files.available(files.SWEEP) and name in files.available(files.SCENARIO):
        refuse_scenario(name)


def _write_design(path: Path, described: dict[str, Any], methods: str | None) -> None:
    """Writes the sweep as a file, with the command that runs it again."""
    from genie_sim.base.paths import atomic_write, read_text
    from genie_sim.scenario.yaml_input import dump

    again = f"genie-sim sweep {path}" + ("" if methods is None else f" --methods {methods}")
    text = dump(described)
    if path.is_file() and read_text(path).partition("\n")[2] != text:
        log.warning("%s: is not as it was written; it is left as it is", path)
        return
    with atomic_write(path) as beside:
        head = f"# To run it again: {again} --out {path.parent.parent}"
        beside.write_text(f"{head}\n{text}", encoding="utf-8")
