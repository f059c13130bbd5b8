"""The commands ``import ...``: files of others become files of genie-sim."""

import click

from genie_sim.cli.import_fetch import fetch
from genie_sim.cli.import_link import import_link
from genie_sim.cli.import_tables import import_tables
from genie_sim.cli.import_truth import truth
from genie_sim.cli.terminal import Commands


@click.group("import", cls=Commands)
def imports() -> None:
    """Read files of others: poses, detections, labels, links."""


for _command in (import_tables, import_link, truth, fetch):
    imports.add_command(_command)
