"""The command ``rerun``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli.arguments import PATH, changed_option, own_code_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument("folder", type=PATH, help="A result folder of a run or of several seeds.")
@changed_option
@own_code_option
def rerun(folder: Path, allow_changed: bool) -> None:
    """Run a result folder again and compare the contents."""
    from genie_sim.runs import folder as run_folder

    with ProgressBar() as progress:
        for run, compared in run_folder.rerun_all(folder, progress, allow_changed=allow_changed):
            begin = "" if run == folder else f"{run.name}/"
            for name, how in compared.files.items():
                click.echo(f"{begin}{name}: {how}")
            if not compared.reproduces:
                raise UserError(f"{run}: the run does not reproduce its own result")
            is_identical = set(compared.files.values()) == {"identical"}
            click.echo(f"{run}: reproduced, {'byte for byte' if is_identical else 'by contents'}")
