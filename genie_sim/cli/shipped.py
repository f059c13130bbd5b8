"""Commands that show and copy what comes with genie-sim: scenarios, sweeps, device profiles."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.paths import atomic_write, read_text
from genie_sim.cli import completion
from genie_sim.cli.arguments import PATH

name_argument = click.argument(
    "name",
    help="Of a scenario, sweep, search, space or device profile; see 'genie-sim list'.",
    shell_complete=completion.files_by_name,
)
kind_option = click.option(
    "--kind",
    type=click.Choice(("scenario", "sweep", "device", "search", "space")),
    help="Which, where a name stands for several.",
)


@click.command()
@name_argument
@kind_option
def show(name: str, kind: str | None) -> None:
    """Print a shipped scenario, sweep, search or device profile."""
    click.echo(read_text(_path(name, kind)).rstrip("\n"))


@click.command()
@name_argument
@click.argument("target", type=PATH, required=False, help="Default: NAME.yaml in this folder.")
@kind_option
def copy(name: str, target: Path | None, kind: str | None) -> None:
    """Copy what 'show' shows, to change it. An existing file stays as it is."""
    source = _path(name, kind)
    target = target or Path(source.name)
    if target.is_dir():
        target = target / source.name
    if target.exists() or target.is_symlink():
        raise UserError(f"{target}: is there already; say where else")
    text = read_text(source)
    with atomic_write(target) as beside:
        beside.write_text(text, encoding="utf-8")
    click.echo(f"{target} (from {source})")


def _path(name: str, kind: str | None) -> Path:
    """The file of a name. Raises ``UserError``, also where it stands for several kinds."""
    from genie_sim.base import files

    kinds = (files.SCENARIO, files.SWEEP, files.DEVICE, files.SEARCH, files.SPACE)
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
