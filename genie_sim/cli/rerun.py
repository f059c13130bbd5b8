"""The command ``rerun``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli.arguments import PATH, changed_option, own_code_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument("folder", type=PATH, help="A result folder.")
@changed_option
@own_code_option
def rerun(folder: Path, allow_changed: bool) -> None:
    """Run a result folder again and compare the contents."""
    from genie_sim.runs import folder as run_folder

    with ProgressBar() as progress:
        compared = run_folder.rerun(folder, progress, allow_changed=allow_changed)
    for name, how in compared.files.items():
        click.echo(f"{name}: {how}")
    if not compared.reproduces:
        raise UserError(f"{folder}: the run does not reproduce its own result")
    is_identical = set(compared.files.values()) == {"identical"}
    click.echo(f"{folder}: reproduced{', byte for byte' if is_identical else ', by contents'}")
