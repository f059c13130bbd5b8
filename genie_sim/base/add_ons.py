"""Commands, importers and exporters of other packages, found through Python's entry points.

Reading them takes as long as the rest of ``genie-sim --help``: they are read for unknown names, and
where a list needs them.
"""

from collections.abc import Iterator
from typing import Any

from genie_sim.base.errors import UserError, as_user_error

COMMANDS = "genie_sim.commands"
IMPORTERS = "genie_sim.importers"
EXPORTERS = "genie_sim.exporters"
# What genie-sim-ros offers: the names of which this package can say who has them.
OF_ROS = {COMMANDS: ("ros",), IMPORTERS: ("bag",), EXPORTERS: ("mcap", "bag")}
INSTALL_ROS = "python -m pip install ./packages/genie-sim-ros"


def names(group: str) -> Iterator[str]:
    """What the installed packages offer in a group."""
    from importlib.metadata import entry_points

    yield from sorted(entry_points(group=group).names)


def offered(group: str, name: str) -> Any:
    """What an installed package offers under a name in a group; ``None``: nothing. Raises
    ``UserError`` for what cannot be imported, and with what to install for what is of ROS.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group=group, name=name):
        with as_user_error(f"{name}, of {entry.value}", Exception):  # it is anybody's code
            return entry.load()
    if name in OF_ROS[group]:
        raise UserError(f"{name}: comes with the add-on for ROS: {INSTALL_ROS}")
    return None
