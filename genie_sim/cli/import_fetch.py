"""The command ``import fetch``. Everything heavy is imported after the arguments are parsed."""

import os
from pathlib import Path

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import expanded
from genie_sim.cli.arguments import PATH
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument(
    "what",
    metavar="{model|drive}",
    help="What is fetched.",
)
@click.argument("name", help="Such as yolox-nano, or 2011_09_26_drive_0005.")
@click.option(
    "--out",
    type=PATH,
    help="The folder; default: $GENIE_SIM_WEIGHTS or weights, $GENIE_SIM_KITTI or kitti.",
)
def fetch(what: str, name: str, out: Path | None) -> None:
    """Take the files of a detector or a drive from the network. No other command touches it."""
    from genie_sim.data import fetch as network

    if what not in ("model", "drive"):
        raise UserError(unknown("kind of thing to fetch", what, ("model", "drive")))
    variable, usual = {
        "model": ("GENIE_SIM_WEIGHTS", "weights"),
        "drive": ("GENIE_SIM_KITTI", "kitti"),
    }[what]
    folder = out or expanded(os.environ.get(variable) or usual)
    take = network.fetch_model if what == "model" else network.fetch_drive
    with ProgressBar(unit="bytes") as progress:
        path = take(name, folder, progress)
    click.echo(f"{path}\nTo use it from anywhere: export {variable}={folder.resolve()}")
    if what == "drive":
        click.echo(
            "KITTI is licensed CC BY-NC-SA 3.0: not for commercial use. https://www.cvlibs.net/datasets/kitti/"
        )
