"""The command ``rerun``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli.arguments import PATH, changed_option, own_code_option
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.argument("folder", type=PATH, help="A result folder of a run, of seeds or of a sweep.")
@changed_option
@own_code_option
def rerun(folder: Path, allow_changed: bool) -> None:
    """Run a result folder again and compare the contents."""
    from genie_sim.runs import folder as run_folder

    if (folder / "sweep.json").is_file() and not (folder / "runs").is_dir():
        _rerun_sweep(folder)
        return
    with ProgressBar() as progress:
        for run, compared in run_folder.rerun_all(folder, progress, allow_changed=allow_changed):
            begin = "" if run == folder else f"{run.name}/"
            for name, how in compared.files.items():
                click.echo(f"{begin}{name}: {how}")
            if not compared.reproduces:
                raise UserError(f"{run}: the run does not reproduce its own result")
            is_identical = set(compared.files.values()) == {"identical"}
            click.echo(f"{run}: reproduced, {'byte for byte' if is_identical else 'by contents'}")


def _rerun_sweep(folder: Path) -> None:
    """Compares each run's metrics. Raises ``UserError``."""
    from genie_sim.base.parallel import workers_here
    from genie_sim.study.study import run_again
    from genie_sim.study.work import Workers

    with ProgressBar(unit="runs") as progress:
        compared = run_again(folder, Workers(workers_here()), progress)
    different = [place for place, how in compared.items() if how != "identical"]
    for place in different:
        click.echo(f"{place}: DIFFERENT")
    if different:
        raise UserError(f"{folder}: {len(different)} of {len(compared)} runs do not reproduce")
    click.echo(f"{folder}: reproduced, the metrics of {len(compared):,} runs")
