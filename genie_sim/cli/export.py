"""The command ``export``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base import add_ons
from genie_sim.base.errors import UserError, unknown
from genie_sim.cli.arguments import PATH, own_code_option

FORMATS = add_ons.OF_ROS[add_ons.EXPORTERS]


@click.command()
@click.argument("folder", type=PATH, help="A result folder of a run.")
@click.option(
    "--format",
    default="mcap",
    help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1), both with the add-on "
    "packages/genie-sim-ros; default: mcap.",
)
@click.option(
    "--out",
    type=PATH,
    help="The file; default: run.mcap and so on in the folder.",
)
@own_code_option
def export(folder: Path, format: str, out: Path | None) -> None:
    """Write a run for Foxglove or RViz."""
    from genie_sim.analysis.seed_runs import load_run

    run = load_run(folder)
    write = add_ons.offered(add_ons.EXPORTERS, format)
    if write is None:
        known = {*FORMATS, *add_ons.names(add_ons.EXPORTERS)}
        raise UserError(f"--format: {unknown('format', format, known)}")
    path = out if out is not None else folder / f"run.{format}"
    click.echo(f"{path}: {write(run, path):,} entries")
