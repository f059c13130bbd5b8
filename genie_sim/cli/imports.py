"""The commands ``import ...``: files of others become files of genie-sim."""

from typing import Any

import click

from genie_sim.base import add_ons
from genie_sim.cli.import_fetch import fetch
from genie_sim.cli.import_link import import_link
from genie_sim.cli.import_tables import import_tables
from genie_sim.cli.import_truth import import_truth
from genie_sim.cli.terminal import Commands


class Importers(Commands):
    """Those of this package and of add-ons."""

    add_on_group = add_ons.IMPORTERS

    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *add_ons.names(self.add_on_group)]


@click.group("import", cls=Importers)
def imports() -> None:
    """Read files of others: poses, detections, labels, links."""


for _command in (import_tables, import_link, import_truth, fetch):
    imports.add_command(_command)
