"""The command ``show``: what comes with genie-sim, and the schemas of files."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.paths import read_text
from genie_sim.cli.arguments import refuse


@click.command()
@click.argument(
    "name",
    help="Of a scenario, sweep or device profile; see 'genie-sim list'.",
)
@click.option(
    "--kind",
    type=click.Choice(("scenario", "sweep", "device")),
    help="Which, where a name stands for several.",
)
@click.option(
    "--schema",
    is_flag=True,
    help="The JSON Schema of 'scenario' or 'device' files instead, for editors.",
)
def show(name: str, kind: str | None, schema: bool) -> None:
    """Print a shipped scenario, sweep or device profile.

    \b
    genie-sim show 3car_hetero > mine.yaml
    genie-sim show --schema scenario > scenario.schema.json
    """
    if schema:
        refuse("with --schema", "kind")
    click.echo((_schema(name) if schema else read_text(_path(name, kind))).rstrip("\n"))


def _schema(what: str) -> str:
    """The JSON Schema of a kind of file. Raises ``UserError``."""
    import json

    from genie_sim.scenario.schema import SCHEMAS, json_schema

    if what not in SCHEMAS:
        raise UserError(unknown("kind of file", what, SCHEMAS))
    return json.dumps(json_schema(what), indent=2) + "\n"


def _path(name: str, kind: str | None) -> Path:
    """The file of a name. Raises ``UserError``, also where it stands for several kinds."""
    from genie_sim.base import files

    kinds = (files.SCENARIO, files.SWEEP, files.DEVICE)
    by_kind = {known.what: files.available(known) for known in kinds if kind in (None, known.what)}
    paths = {what: names[name] for what, names in by_kind.items() if name in names}
    if len(paths) > 1:
        what, first = " and a ".join(paths), next(iter(paths))
        raise UserError(f"{short_repr(name)} is a {what}: say which with --kind {first}")
    if not paths:
        what = kind or "shipped file"
        names = {known for known_names in by_kind.values() for known in known_names}
        raise UserError(unknown(what, name, names))
    return next(iter(paths.values()))
