"""The command line. Everything heavy is imported after the arguments are parsed."""

import logging
import os
import sys

import click

from genie_sim.base import add_ons, plugins
from genie_sim.base.errors import UserError
from genie_sim.base.text import one_line
from genie_sim.cli import terminal
from genie_sim.cli.compare import compare
from genie_sim.cli.export import export
from genie_sim.cli.figures import figures
from genie_sim.cli.imports import imports
from genie_sim.cli.list_names import list_
from genie_sim.cli.perceive import perceive
from genie_sim.cli.profile import profile
from genie_sim.cli.report import report
from genie_sim.cli.reproduce import reproduce
from genie_sim.cli.rerun import rerun
from genie_sim.cli.run import run
from genie_sim.cli.show import show
from genie_sim.cli.sweep import sweep
from genie_sim.cli.table import table
from genie_sim.cli.terminal import Commands
from genie_sim.version import VERSION

# in the order of the help
COMMANDS: tuple[click.Command, ...] = (
    *(run, sweep, reproduce, rerun),
    *(report, table, figures, compare, export),
    *(perceive, imports, profile),
    *(list_, show),
)
EXAMPLES = """\b
genie-sim run 3car_hetero
genie-sim run 3car_hetero --set cars[0].device=orin_nano --seed 7
genie-sim reproduce --quick

Simulates Genie, the smart ROS cache for connected vehicles and edge servers.
"""


class AllCommands(Commands):
    """Those of this package, and those of add-ons by name."""

    add_on_group = add_ons.COMMANDS


@click.group(
    cls=AllCommands,
    help=EXAMPLES,
    epilog="genie-sim ros, for real ROS, comes with the add-on packages/genie-sim-ros.",
    invoke_without_command=True,
    context_settings={"show_default": True},
)
@click.version_option(
    VERSION,
    message="genie-sim %(version)s",
    help="Print the version and exit.",
)
@click.option(
    "--debug/--no-debug", expose_value=False, help="Show where it failed: what the cause was."
)
@click.pass_context
def app(context: click.Context) -> None:
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for _command in COMMANDS:
    app.add_command(_command)


@plugins.own_code_allowed(allowed=False)  # but to a command that allows it
def main(argv: list[str] | None = None) -> int:
    """Runs the command line. Exit status: 0 done, 1 the user's input or environment, 2 usage, 130
    Ctrl-C or SIGTERM.
    """
    terminal.open_closed_streams()
    # figures go to files; a window that is asked for here may not even exist
    os.environ["MPLBACKEND"] = "agg"
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of a home without its folder
    try:
        status = app(args=argv, prog_name="genie-sim", standalone_mode=False)
    except SystemExit as stop:
        if isinstance(stop.code, int | None):
            return stop.code or 0
        print(f"genie-sim: {one_line(str(stop.code))}", file=sys.stderr)
        return 1
    except click.UsageError as error:
        command = "genie-sim" if error.ctx is None else error.ctx.command_path
        text = one_line(error.format_message()).rstrip(".")
        print(f"genie-sim: {text}; see {command} --help", file=sys.stderr)
        return 2
    except UserError as error:
        cause = error.__cause__
        # looked for here: click keeps the option's value only while the command runs
        if cause is not None and "--debug" in (sys.argv if argv is None else argv):
            raise cause from None
        is_own = cause is not None and plugins.own_fault(cause) is not None
        more = "; genie-sim --debug shows more" if is_own else ""
        print(f"genie-sim: {one_line(str(error))}{more}", file=sys.stderr)
        return 1
    except (OSError, MemoryError) as error:
        # the machine's fault; where a file is wrong, a UserError has named it
        terminal.drop_output()
        print(f"genie-sim: {terminal.machine_said(error)}", file=sys.stderr)
        return 1
    return status or 0
