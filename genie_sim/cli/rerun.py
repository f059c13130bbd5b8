"""The command ``rerun``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli.arguments import PATH, own_code_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument("folder", type=PATH, help="A result folder of any kind.")
@own_code_option
def rerun(folder: Path) -> None:
    """Run a result folder again and compare the contents."""
    from genie_sim import kinds

    result = kinds.load(folder)
    seconds = isinstance(result, kinds.Run | kinds.Runs)
    with ProgressBar("s of all methods" if seconds else "runs") as progress:
        for line in result.rerun(progress):
            click.echo(line)
