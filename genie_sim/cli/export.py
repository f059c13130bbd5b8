"""The command ``export``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import completion
from genie_sim.cli.arguments import (
    PATH,
    changed_option,
    listed,
    own_code_option,
    shown_methods_option,
)

if TYPE_CHECKING:
    from genie_sim.record.results import Run

NAMES = {"mcap": "run.mcap", "bag": "run.bag", "perfetto": "run.perfetto.json"}  # by format
OF_EVERY_METHOD = ("poses", "power")  # tables whose rows belong to all methods


@click.command()
@click.argument("folder", type=PATH, help="A result folder of a run.")
@click.option(
    "--format",
    default="mcap",
    shell_complete=completion.fixed(*NAMES),
    help="mcap (Foxglove, ROS 2), bag (RViz, ROS 1) or perfetto (a timeline of hosts and frames for"
    " ui.perfetto.dev).",
)
@shown_methods_option
@click.option(
    "--out", type=PATH, help="The file; default: run.mcap and so on in the result folder."
)
@changed_option
@own_code_option
def export(
    folder: Path, format: str, methods: str | None, out: Path | None, allow_changed: bool
) -> None:
    """Write a run for Foxglove, RViz or Perfetto."""
    if format not in NAMES:
        raise UserError(f"--format: {unknown('format', format, NAMES)}")
    from genie_sim.record import results

    run = _of_methods(
        results.load(folder, allow_changed=allow_changed), listed("--methods", methods)
    )
    path = out if out is not None else folder / NAMES[format]
    if format == "perfetto":
        from genie_sim.report import perfetto

        click.echo(f"{path}: {perfetto.export(run, path):,} events")
    else:
        from genie_sim.ros import export as bags

        click.echo(f"{path}: {bags.export(run, path, format):,} messages")


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
