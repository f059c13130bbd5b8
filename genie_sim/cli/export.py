"""The command ``export``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from genie_sim.base import add_ons
from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import completion
from genie_sim.cli.arguments import (
    PATH,
    listed,
    own_code_option,
    shown_methods_option,
)

if TYPE_CHECKING:
    from genie_sim.record.results import Run

FORMATS = add_ons.OF_ROS[add_ons.EXPORTERS]
OF_EVERY_METHOD = ("poses", "power")  # tables whose rows belong to all methods


@click.command()
@click.argument("folder", type=PATH, help="A result folder of a run.")
@click.option(
    "--format",
    default="mcap",
    shell_complete=completion.fixed(*FORMATS),
    help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1), both with the add-on "
    "packages/genie-sim-ros; default: mcap.",
)
@shown_methods_option
@click.option(
    "--out",
    type=PATH,
    help="The file; default: run.mcap and so on in the folder.",
)
@own_code_option
def export(folder: Path, format: str, methods: str | None, out: Path | None) -> None:
    """Write a run for Foxglove or RViz."""
    from genie_sim.analysis.seed_runs import load_run

    run = _of_methods(load_run(folder), listed("--methods", methods))
    write = add_ons.offered(add_ons.EXPORTERS, format)
    if write is None:
        known = {*FORMATS, *add_ons.names(add_ons.EXPORTERS)}
        raise UserError(f"--format: {unknown('format', format, known)}")
    path = out if out is not None else folder / f"run.{format}"
    click.echo(f"{path}: {write(run, path):,} entries")


def _of_methods(run: "Run", names: list[str]) -> "Run":
    """The run with the rows of these methods alone; of none, all. Raises ``UserError``."""
    if not names:
        return run
    from dataclasses import replace

    known = [method.name for method in run.methods]
    for name in names:
        if name not in known:
            raise UserError(f"--methods: {unknown('method', name, known)}")
    tables = {
        table: rows if table in OF_EVERY_METHOD else rows.rows(rows["method"].isin(names))
        for table, rows in run.tables.items()
    }
    return replace(run, tables=tables)
