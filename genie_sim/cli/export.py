"""The command ``export``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli import completion
from genie_sim.cli.arguments import PATH, changed_option, own_code_option


@click.command()
@click.argument("folder", type=PATH, help="A result folder.")
@click.option(
    "--format",
    default="mcap",
    shell_complete=completion.fixed("mcap", "bag"),
    help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1).",
)
@click.option("--out", type=PATH, help="The file; default: run.mcap or run.bag in the folder.")
@changed_option
@own_code_option
def export(folder: Path, format: str, out: Path | None, allow_changed: bool) -> None:
    """Write a run as a bag, for Foxglove or RViz."""
    from genie_sim.record import results
    from genie_sim.ros import export as bags

    path = out if out is not None else folder / f"run.{format}"
    count = bags.export(results.load(folder, allow_changed=allow_changed), path, format)
    click.echo(f"{path}: {count:,} messages")
